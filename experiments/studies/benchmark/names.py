"""What the benchmark's rows are called: of what is measured and of what shows it."""

OPERATIONS = ("encode", "bundle", "hamming", "train", "predict")
OURS = "hdc"
OURS_COMPILED = "hdc, compiled"
READ = "one read of the bytes"
