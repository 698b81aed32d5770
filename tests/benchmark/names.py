"""Names of routes and the order of operations; ordinary routes are those of other libraries."""

OPERATIONS = ("encode", "bundle", "hamming", "train", "predict", "folder", "video")
OURS, OURS_COMPILED, OURS_GPU = "hdc", "hdc, compiled", "hdc, on the GPU"
ENCODE_GPU = "torch.median, compare, on the GPU"
READ, COPY = "one read of the bytes", "one copy of the bytes"
NUMKONG, TORCHHD_BUNDLE = "numkong.cdist", "torchhd.multiset"
DECODE_IMAGES, DECODE_VIDEO = (
    "cv2.imread alone, as many threads",
    "cv2.VideoCapture alone",
)
TORCHHD_TRAIN = "torch.median, torchhd.multiset"
NO_RESULT = (READ, COPY, DECODE_IMAGES, DECODE_VIDEO)
ORDINARY_ROUTES = (
    TORCHHD_TRAIN,
    "numpy.median, torchhd.multiset",
    "cv2.calcHist, torchhd.multiset",
)
