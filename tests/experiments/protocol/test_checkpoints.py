"""When a model in training is tested."""

from itertools import pairwise

import pytest

from experiments.protocol.checkpoints import Checkpoints, Due
from experiments.studies.table1 import tables


def asked(reports, accuracies=None, target=0.9, n_train=400):
    """What is asked at each report; accuracies of training, by number of report."""
    checkpoints = Checkpoints(target, n_train)
    found = []
    for k, report in enumerate(reports):
        due = checkpoints.due(report)
        found.append(due)
        if due is not Due.NOTHING:
            share = (accuracies or {}).get(k, 0.0) if due is Due.ALL else None
            checkpoints.passed(report, share)
    return found


def batches(*shares, step=20):
    return [
        {"samples_seen": step * k, "loss": 1.0, "batch_accuracy": share}
        for k, share in enumerate(shares, 1)
    ]


@pytest.mark.parametrize(
    ("reports", "tested", "all_asked"),
    [
        # Far from the target the test frames alone, and ever less often.
        (batches(*[0.2] * 32), [1, 2, 4, 8, 16, 32], []),
        # From half of the target on the training frames too, at a twentieth more.
        (batches(*[0.2] * 20, *[0.45] * 20), [1, 2, 4, 8, 16], [*range(21, 40, 2)]),
        # Without a batch accuracy every checkpoint is of all frames.
        (
            [{"samples_seen": 20 * k, "loss": 1.0} for k in range(1, 14)],
            [],
            [*range(1, 12), 13],
        ),
        ([{"samples_seen": 20 * k} for k in range(1, 9)], [], [1, 2, 4, 8]),
    ],
)
def test_checkpoints_are_rarer_far_from_the_target(reports, tested, all_asked):
    found = list(enumerate(asked(reports, n_train=160), 1))
    assert [k for k, due in found if due is Due.TEST] == tested
    assert [k for k, due in found if due is Due.ALL] == all_asked


def test_the_papers_training_accuracies_are_met_at_a_twentieth_and_the_rest_at_a_fifth():
    reports = batches(*[1.0] * 40)
    papers = max(p for p in map(tables.papers_training_accuracy, tables.PAPER) if p)
    before = asked(reports, accuracies=dict.fromkeys(range(40), papers))
    after = asked(reports, accuracies=dict.fromkeys(range(40), 0.9975))
    assert before.count(Due.ALL) > after.count(Due.ALL) > 0
    seen = [k for k, due in enumerate(after, 1) if due is not Due.NOTHING]
    assert all(b <= 1.2 * a + 1 for a, b in pairwise(seen))


def test_a_model_that_does_not_say_how_many_samples_it_saw_is_tested_each_time():
    for report in ({}, {"loss": 1.0}, {"loss": 1.0, "batch_accuracy": 1.0}):
        assert asked([report] * 4) == [Due.ALL] * 4
