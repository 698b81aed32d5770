"""Accuracy from correlations of pairs alone: no frame is classified, no number is fitted.

Given the mean correlation C of every pair of classes (Eq. 5 of hypervectors, Eq. 4 of frames), the
scatter of single pairs about it, and N_s. A classifier compares a query of class q with something
made of N_s samples of class l; its score is r_ql on average, and spreads with

    σ² = g²·(v_sample/N_s + v_query) + noise,    g = ∂r/∂C,

v_sample the variance of C over the samples of a class for one query, v_query that over queries of
their mean correlation with the class, less what a query has in common with all classes. With F_l
the distribution of score l, the largest is that of q with the probability (order statistics of L
independent numbers) ∫₀¹ Π_{l≠q} F_l(F_q⁻¹(u)) du. Single correlations are skewed: few samples are
like the query, most are not. So F is a shifted gamma distribution (Pearson's type III), of which a
mean of N_s numbers is again one; without skewness it is a Gaussian. Skewness was taken in after
Gaussians had missed the accuracies of a sensor (seed 0): both are reported.

**HDC.** A bit is the sign of a Gaussian number. The hypervectors of a class share at each pixel a
Gaussian z_l, so that by the arcsine law, C = (2/π)·asin ρ, a bit is one with probability
π_l(z) = Φ(√ρ_ll·z/√(1 − ρ_ll)), the majority (Eq. 1) with M(z) = P(Bin(N_s, π_l(z)) > N_s/2) (half
of the ties), the bit of a query with Φ(β·z/√(1 − β²)), β = ρ_ql/√ρ_ll, and (Eq. 2)

    r_ql = E_z[(2Φ(β·z/√(1 − β²)) − 1)·(2M(z) − 1)],    noise = (1 − κ_ql)/D,

κ the correlation of the prototypes. **Mean frame**, compared by correlation: for frames of equal
contrast r_ql = g·C_ql, g = √(N_s/(1 + (N_s − 1)·C_ll)), and no noise but the scatter.

Assumed besides: all pairs of a class are equally correlated, scores are independent from class to
class and the majority passes their noise on as it does a small change of C, the D bits are
independent, correlations are not negative.

**Another quantile than the median**: :func:`best_quantile`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special
from scipy.special import gammainc, gammaincinv, gammaln, ndtr
from torch import Tensor

from hdc import bits
from hdc.bank import Bank

Floats = NDArray[np.float64]
Shares = NDArray[np.int64]  # N_s of each class [L]

_NODES = 80  # of the quadratures: doubling them changes no accuracy by 1e-4
_STEP = 1e-4  # of C, for its derivative
_NO_SKEW = 1e-3  # a gamma distribution of this skewness is a Gaussian to four digits
_NO_LESS = 1e-24  # variance of a score
_LEAST, _MOST = 1e-9, 1 - 1e-9  # of ρ, where Φ becomes a step


class Correlations(NamedTuple):
    """Correlations of L classes; row: class of the query, column: that of the samples.

    Attributes:
        mean: C_ll′ [L, L].
        sample: standard deviation over the samples of a class, for one query [L, L].
        query: standard deviation over queries of the mean with a class, less what the query has in
            common with all classes [L, L].
        skew: skewness over the samples of a class, for one query [L, L]; zero: Gaussian noise.
    """

    mean: Floats
    sample: Floats
    query: Floats
    skew: Floats


def correlations(pairs: Floats, labels: NDArray[np.int64]) -> Correlations:
    """Mean and scatter from the correlations of all pairs [N, N], whose diagonal is left out.

    Raises:
        ValueError: for a class of fewer than three samples.
    """
    classes, counts = np.unique(labels, return_counts=True)
    if counts.min() < 3:
        raise ValueError(
            f"labels: expected three samples of every class, found {counts.min()}"
        )
    pairs = pairs.copy()
    np.fill_diagonal(pairs, np.nan)
    members = [np.flatnonzero(labels == c) for c in classes]
    mean, sample, query, third = np.empty((4, len(classes), len(classes)))
    for row, queries in enumerate(members):
        deviations = []
        for column, samples in enumerate(members):
            block = pairs[np.ix_(queries, samples)]
            of_query = np.nanmean(block, axis=1, keepdims=True)
            mean[row, column] = np.nanmean(block)
            sample[row, column] = np.nanvar(block, axis=1, ddof=1).mean()
            third[row, column] = np.nanmean((block - of_query) ** 3)
            deviations.append(of_query[:, 0] - mean[row, column])
        common = np.mean(deviations, axis=0)
        query[row] = np.var(deviations - common, axis=1, ddof=1)
    # A mean over n samples keeps 1/n of their variance, which `sample` has already.
    query = np.maximum(query - sample / counts, 0)
    skew = third / sample**1.5
    return Correlations(mean, np.sqrt(sample), np.sqrt(query), skew)


def bit_correlations(words: Tensor, dimension: int) -> Floats:
    """Correlation coefficients of all pairs of hypervectors int64 [N, W], float64 [N, N]."""
    ones = bits.count_ones(words).numpy() / dimension
    distances = bits.hamming(words, words).numpy() / dimension
    both = (ones[:, None] + ones - distances) / 2
    deviation = np.sqrt(ones * (1 - ones))
    covariance = both - np.outer(ones, ones)
    return covariance / np.outer(deviation, deviation)


def correlations_of(
    bank: Bank, rows: NDArray[np.int64]
) -> tuple[Correlations, Correlations]:
    """:func:`correlations` of the hypervectors and of the grey values of some frames of a bank."""
    labels = bank.labels[rows]
    of_bits = bit_correlations(bank.words()[rows], bank.dimension)
    standardised, _ = bank.kernel(rows, rows[:0], "standardised")
    of_greys = standardised.numpy() / bank.dimension
    return correlations(of_bits, labels), correlations(of_greys, labels)


def hdc_accuracy(moments: Correlations, n: int, dimension: float) -> float:
    """Probability that HDC is right about a sample of any class, in equal shares.

    Where the n ≥ L training samples of all classes together are no multiple of L, each class in
    turn is among those that have one more.
    """

    def scores(shares: Shares) -> tuple[Floats, Floats, Floats]:
        within = np.diag(moments.mean)
        r = expected(moments.mean, shares)
        r_beyond = expected(moments.mean + _STEP, shares, within)
        gain = (r_beyond - r) / _STEP
        noise = (1 - _alike(moments.mean, shares)) / dimension
        return r, gain, noise

    return _accuracy(moments, n, scores)


def mean_image_accuracy(moments: Correlations, n: int) -> float:
    """The same for the mean frame of each class, from correlations of frames."""

    def scores(shares: Shares) -> tuple[Floats, Floats, Floats]:
        within = np.diag(moments.mean)
        gain = np.sqrt(shares / (1 + (shares - 1) * within))
        none = np.zeros_like(moments.mean)
        return gain * moments.mean, gain + none, none

    return _accuracy(moments, n, scores)


class Light(NamedTuple):
    """What speckle and its noise are, where the mean of the pixels that are lit is 1.

    Attributes:
        dark: share of the pixels that no light reaches, in [0, 1).
        photon: variance of a pixel within a class, over its intensity.
        read: variance that every pixel has besides.
        change: variance of a pixel between two classes, over its intensity; above zero.
    """

    dark: float
    photon: float
    read: float
    change: float


def best_quantile(light: Light) -> float:
    """The quantile q of a frame at which one threshold tells two classes of speckle apart best.

    The intensity I of fully developed speckle is exponential, and small changes move it across
    the threshold t in a share e^(−t)·√v(t) of the pixels, up to a constant: within a class with
    v = photon·I + read, between two with change·I more, because a change of the field moves √I.
    Of the numbers of bits that differ, the difference of means over their deviation,

        d′(t) ∝ e^(−t)·(√v_between − √v_within)/√(e^(−t)·(√v_between + √v_within)),

    has its maximum at t = ½, the quantile 0.39 of the lit pixels, without `read`, and at a larger t
    with it. Dark pixels lie below any such threshold: q = dark + (1 − dark)·(1 − e^(−t)).

    Where it holds and where it does not: the table `quantiles` of experiments/studies/quantiles.
    """
    t = np.linspace(0.01, 6, 600)
    within = np.sqrt(light.photon * t + light.read)
    between = np.sqrt((light.photon + light.change) * t + light.read)
    contrast = np.exp(-t / 2) * (between - within) / np.sqrt(between + within)
    of_lit = 1 - np.exp(-t[contrast.argmax()])
    return float(light.dark + (1 - light.dark) * of_lit)


def _accuracy(
    moments: Correlations,
    n: int,
    scores: Callable[[Shares], tuple[Floats, Floats, Floats]],
) -> float:
    """Mean over the ways to share n samples; `scores` gives r, g and the noise."""
    n_classes = len(moments.mean)
    base = np.full(n_classes, n // n_classes)
    base[: n % n_classes] += 1
    u, weight = special.roots_sh_legendre(_NODES)
    right = []
    n_turns = 1 if n % n_classes == 0 else n_classes
    for turn in range(n_turns):
        shares = np.roll(base, turn)
        r, gain, noise = scores(shares)
        sample_variance = moments.sample**2 / shares
        variance = gain**2 * (sample_variance + moments.query**2)
        third = gain**3 * moments.skew * moments.sample**3 / shares**2
        for q in range(n_classes):
            sigma = np.sqrt(variance[q] + noise[q] + _NO_LESS)
            skewness = np.maximum(third[q] / sigma**3, _NO_SKEW)
            shape = 4 / skewness**2  # of a gamma distribution of this skewness
            quantile = gammaincinv(shape[q], u)
            own_score = (quantile - shape[q]) / np.sqrt(shape[q])
            own = r[q, q] + sigma[q] * own_score[:, None]
            others = np.arange(n_classes) != q
            margin = (own - r[q, others]) / sigma[others]
            shape = shape[others]
            reached = np.maximum(shape + np.sqrt(shape) * margin, 0)
            below = gammainc(shape, reached)
            right.append(weight @ below.prod(axis=1))
    return float(np.mean(right))


def expected(mean: Floats, shares: Shares, within: Floats | None = None) -> Floats:
    """r [L, L], correlation of a query of class q with the prototype of class l.

    Args:
        mean: C^b of queries with samples [L, L].
        shares: N_s of each class [L].
        within: C^b among the samples of a class [L]; the diagonal of `mean`, if None.
    """
    z, weight = _normal()
    rho = _gaussian(np.diag(mean) if within is None else within)
    votes = _votes(z, rho, shares)
    beta = np.clip(_gaussian(mean) / np.sqrt(rho), 0, _MOST)[..., None]
    bit = 2 * ndtr(beta * z / np.sqrt(1 - beta**2)) - 1
    return np.einsum("qlz,lz,z->ql", bit, votes, weight)


def _alike(mean: Floats, shares: Shares) -> Floats:
    """κ [L, L]: correlation of the prototypes; of one with itself, its mean with the others.

    By Mehler's formula: E f(z)·g(z′) = Σ_k f_k·g_k·ρ^k of the coefficients of Hermite polynomials.
    """
    z, weight = _normal()
    rho = _gaussian(np.diag(mean))
    lengths = np.sqrt(np.outer(rho, rho))
    between = np.clip(_gaussian(mean) / lengths, 0, 1)  # of z_q and z_l
    order = np.arange(_NODES)
    norms = np.exp(gammaln(order + 1) / 2)
    polynomials = special.eval_hermitenorm(order[:, None], z) / norms[:, None]
    votes = _votes(z, rho, shares)
    parts = (votes * weight) @ polynomials.T
    powers = between[..., None] ** order
    alike = np.einsum("qk,lk,qlk->ql", parts, parts, powers)
    rest = alike.sum(1) - np.diag(alike)
    np.fill_diagonal(alike, rest / max(len(rho) - 1, 1))
    return alike


def _votes(z: Floats, rho: Floats, shares: Shares) -> Floats:
    """2M(z) − 1 for each class [L, len(z)]."""
    steepness = np.sqrt(rho / (1 - rho))
    p = ndtr(steepness[:, None] * z)
    at_least_half = _more_than((shares - 1) // 2, shares, p)
    above_half = _more_than(shares // 2, shares, p)
    return at_least_half + above_half - 1


def _more_than(k: Shares, shares: Shares, p: Floats) -> Floats:
    """P(Bin(N_s, p) > k) of each class [L, len(z)]."""
    return special.bdtrc(k[:, None].astype(float), shares[:, None], p)


def _gaussian(correlation: Floats) -> Floats:
    """ρ of the Gaussians whose signs have this correlation."""
    rho = np.sin(np.pi / 2 * np.asarray(correlation))
    return np.clip(rho, _LEAST, _MOST)


def _normal() -> tuple[Floats, Floats]:
    """Nodes and weights of the mean over a standard normal number."""
    z, weight = special.roots_hermitenorm(_NODES)
    return z, weight / weight.sum()
