"""Names of routes and the order of operations; ordinary routes are those of other libraries."""

OPERATIONS = ("encode", "bundle", "hamming", "train", "predict")
OURS, OURS_COMPILED = "hdc", "hdc, compiled"
READ, COPY = "one read of the bytes", "one copy of the bytes"
NUMKONG, TORCHHD_BUNDLE = "numkong.cdist", "torchhd.multiset"
TORCHHD_TRAIN = "torch.median, torchhd.multiset"
ORDINARY_ROUTES = (TORCHHD_TRAIN, "numpy.median, torchhd.multiset")
