"""A read-out of one's own, without scores in closed form."""

import torch

from hdc import bits
from hdc.readouts import Readout


class Nearest(Readout):
    """The nearest mean hypervector of a class."""

    def fit(self, words, rows, n_classes, dimension):
        ones = bits.unpack(words, dimension).double()
        self.means_ = torch.stack([ones[rows == c].mean(0) for c in range(n_classes)])
        return self

    def scores(self, words):
        ones = bits.unpack(words, self.means_.shape[1]).double()
        return -(torch.cdist(ones, self.means_) ** 2)
