"""Labels in rows are small, and come back as they were."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.records.rows import pack_labels, unpack_labels

LABELS = st.lists(st.integers(0, 2**31 - 1), max_size=50)


@given(LABELS, st.sampled_from([1, 2**8, 2**16]))
def test_labels_come_back_as_they_were(labels, scale):
    labels = [label // scale for label in labels]
    found = unpack_labels(json.loads(json.dumps(pack_labels(labels))))
    assert found.dtype == np.int64
    assert found.tolist() == labels


@pytest.mark.parametrize("labels", [[-1], [2**31], [0.5], [[1, 2]], ["a"]], ids=repr)
def test_what_is_no_label_is_refused(labels):
    with pytest.raises(ValueError, match=r"^labels: expected "):
        pack_labels(labels)


@pytest.mark.parametrize("text", ["", "u1", "u9:AAAA", "u1:!", "u2:eJw=", "i4:abcd"])
def test_a_damaged_text_is_refused(text):
    with pytest.raises(ValueError, match=r"^labels: expected packed integers"):
        unpack_labels(text)
