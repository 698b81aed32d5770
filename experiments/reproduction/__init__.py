"""The steps of the reproduction: what they are, how they are called, what they took."""
