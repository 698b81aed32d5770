"""Products of frames and of matrices of bytes are exact."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from baselines import products
from baselines.products import integer_product


@pytest.mark.parametrize("native", [True, False])
@pytest.mark.parametrize("k", [1, 1023, 1025, 140_000])
def test_product_is_exact_at_its_extremes(native, k, monkeypatch):
    if not native:
        monkeypatch.setattr(products, "native_is_exact", lambda: False)
    else:
        monkeypatch.setattr(products, "native_is_fast", lambda: True)
    a = torch.full((3, k), -128, dtype=torch.int8)
    a[1] = 127
    expected = a.numpy().astype(np.int64) @ a.numpy().astype(np.int64).T
    assert (integer_product(a, a.T).numpy() == expected).all()


def test_strides_of_single_rows_and_columns_do_not_matter():
    """torch._int_mm alone is silently wrong here."""
    row = torch.arange(-3, 4, dtype=torch.int8)
    for a in (row[None], row[None].as_strided((1, 7), (0, 1))):
        assert integer_product(a, a.T).item() == 28
        assert (integer_product(a.T, a).numpy() == np.outer(row, row)).all()


@settings(max_examples=40, deadline=None)
@given(
    st.integers(1, 5),
    st.integers(1, 5),
    st.integers(2, 90),
    st.booleans(),
    st.integers(0, 2**32),
)
def test_products_and_moments_are_those_of_python_integers(n, m, d, sixteen, seed):
    top, dtype = (65536, torch.int32) if sixteen else (256, torch.uint8)
    x = np.random.default_rng(seed).choice(
        [0, 1, top // 2, top - 2, top - 1], (n + m, d)
    )
    images = torch.from_numpy(x).to(dtype)
    y = x.astype(object) - products.constant_of(images)
    assert (
        products.cross_products(images[:n], images[n:]).numpy() == y[:n] @ y[n:].T
    ).all()
    first, second = products.moments(images)
    assert (first.numpy() == y.sum(1)).all()
    assert (second.numpy() == (y * y).sum(1)).all()
