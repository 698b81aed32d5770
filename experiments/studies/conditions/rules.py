"""What the rules of reading a curve are called: of what reads by them and of what shows it."""

RULES = ("r1", "r2", "r3", "r4")
