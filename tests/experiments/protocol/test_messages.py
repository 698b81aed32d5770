"""A user's error is one line that says what to write."""

import shlex

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from experiments.protocol.messages import is_users, message
from tests.experiments.composed import tree


def error_of(*words):
    with pytest.raises(Exception, match=r"\S") as caught:
        tree(*words)
    return caught.value


@pytest.mark.parametrize("value", ["/d/day=1,left (b)", "'/d/day=1,left (b)'x", "a(b"])
def test_a_value_that_hydra_cannot_read_is_shown_in_quotes_that_it_can(value):
    """`mismatched input '=' expecting <EOF>` named no key."""
    said = message(error_of(f"scene.path={value}"))
    key, _, rest = said.partition(": ")
    assert key == "scene.path"
    (word,) = shlex.split(rest.rpartition(": ")[2])
    (override,) = OverridesParser.create().parse_overrides([word])
    assert override.value() == value.strip("'")


def test_a_key_that_not_every_model_of_a_sweep_has_says_how_to_sweep_it():
    words = ["model.lr=1e-3"]
    error = error_of("model=hdc", *words)
    said = message(error, ["-m", "model=hdc,softmax", *words])
    assert said.startswith("model.lr: expected 'model.lr=choice(1e-3)', for a sweep")
    assert "choice" not in message(error, ["model=hdc", *words])  # no sweep
    assert "choice" not in message(error, ["-m", "model=hdc,softmax"])
    again = message(error, ["-m", "model=hdc,softmax", "model.lr=choice(1e-3)"])
    assert again.startswith("model.lr: expected a model that has it; leave the others")


def test_a_launcher_that_cannot_start_is_the_users_and_our_own_errors_are_not():
    submitit = pytest.importorskip("submitit")
    with pytest.raises(RuntimeError, match="srun") as caught:
        submitit.SlurmExecutor("folder")
    assert is_users(caught.value)
    assert is_users(ValueError("n: expected 1"))
    with pytest.raises(ZeroDivisionError) as ours:
        raise ZeroDivisionError
    assert not is_users(ours.value)
