"""The forms that are named wherever recordings are compared: in the forest, the costs, error
against training time and README."""

RIVAL_FORM = "softmax_dual_standardised"
"""Against which the others are held: softmax regression on frames of mean 0 and deviation 1."""
FORMS = (
    "hdc",  # as published
    "hdc_lda",  # one bit per pixel, with LDA
    "hdc_levels_lda",  # seven bits per pixel, with LDA
    "hdc_deviation_lda",
    RIVAL_FORM,
    "mean_image",  # nearest class mean
    "thumbnail",
)
