"""Integer products and Gram matrices are exact, whatever the road."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from baselines import integer
from baselines.dual import centred_gram
from baselines.integer import integer_product, pack, unpack
from baselines.pixels import PixelScaling


@pytest.mark.parametrize("native", [True, False])
@pytest.mark.parametrize("k", [1, 1023, 1025, 140_000])
def test_product_is_exact_at_its_extremes(native, k, monkeypatch):
    if not native:
        monkeypatch.setattr(integer, "native_is_exact", lambda: False)
    a = torch.full((3, k), -128, dtype=torch.int8)
    a[1] = 127
    expected = a.numpy().astype(np.int64) @ a.numpy().astype(np.int64).T
    assert (integer_product(a, a.T).numpy() == expected).all()
    assert integer.INT32_TERMS * 128**2 < 2**31


@pytest.mark.parametrize("wide", [False, True])
def test_gram_matrix_is_exact_before_centring(wide):
    rng = np.random.default_rng(0)
    top = 65536 if wide else 256
    x = rng.integers(0, top, (5, 40_000))
    x[0], x[1] = top - 1, 0
    dtype = torch.int32 if wide else torch.uint8
    gram = centred_gram(torch.from_numpy(x).to(dtype), PixelScaling())
    # Centred exactly: N²·K is an integer.
    exact = len(x) * x.astype(object) - x.sum(axis=0).astype(object)
    expected = (exact @ exact.T / len(x) ** 2).astype(float)
    np.testing.assert_allclose(gram.numpy(), expected, rtol=1e-12, atol=1e-12 * abs(expected).max())


@pytest.mark.parametrize("count", [1, 7, 8, 9, 63, 64, 65])
def test_packing_is_undone_by_unpacking(count):
    bits = torch.from_numpy(np.random.default_rng(count).random((3, count)) < 0.5)
    assert (unpack(pack(bits), count) == bits).all()
    assert unpack(pack(bits))[:, count:].sum() == 0


def test_strides_of_single_rows_and_columns_do_not_matter():
    """torch._int_mm alone is silently wrong here."""
    row = torch.arange(-3, 4, dtype=torch.int8)
    for a in (
        row[None],
        row[None].as_strided((1, 7), (0, 1)),
        row[None].as_strided((1, 7), (1, 1)),
    ):
        assert integer_product(a, a.T).item() == 28
        assert (integer_product(a.T, a).numpy() == np.outer(row, row)).all()


def test_a_saturating_product_is_noticed(monkeypatch):
    def saturating(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        return (a.long() @ b.long()).clamp(max=32767).int()

    monkeypatch.setattr(torch, "_int_mm", saturating)
    integer.native_is_exact.cache_clear()
    assert not integer.native_is_exact()
    integer.native_is_exact.cache_clear()
