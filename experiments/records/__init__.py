"""Records of runs, written whole and read with care; no number follows from it."""
