"""Other ways to classify the same frames: torchhd's classifiers of the same bits, and networks."""
