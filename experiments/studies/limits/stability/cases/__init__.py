"""Cases that numbers break on; each module registers its own when it is imported."""
