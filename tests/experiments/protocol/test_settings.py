"""Typed parts of a config, and the experiments that it names."""

import pytest

from experiments.protocol.settings import named


@pytest.mark.parametrize(
    ("before", "today"),
    [
        ("stability.measure.stability", "limits.stability.measure.stability"),
        ("values.measure.coverage", "promises.values.measure.coverage"),
        ("times.measure.times_grid", "table1.times.measure.times_grid"),
    ],
)
def test_an_experiment_that_moved_since_version_2_is_named_where_it_is(before, today):
    with pytest.raises(ValueError, match=rf"expected experiments\.studies\.{today}, "):
        named({"_target_": f"experiments.studies.{before}"})
    assert callable(named({"_target_": f"experiments.studies.{today}"}))
