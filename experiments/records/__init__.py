"""What is left of a run, written whole and read with care: decides no number."""
