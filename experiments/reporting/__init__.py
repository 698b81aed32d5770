"""How numbers are shown; knows no study."""
