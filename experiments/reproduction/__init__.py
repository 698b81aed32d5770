"""The steps of the reproduction, and make, which carries them out."""
