"""Which frames of a recording a command holds out, to judge a model by."""

from __future__ import annotations

import numpy as np

from hdc.readers import Recording

UNSEEN_GROUPS = "in groups that training has not seen"


def hold_out(
    recording: Recording, fraction: float | None, by_order: bool = False
) -> tuple[np.ndarray, np.ndarray, str]:
    """Indices to train on and to hold out, increasing, and how these were chosen.

    The last sessions where there are several, else whole groups where they are known, else the
    same share of each class, or of all where numbers are learnt: at random, or `by_order` the last.

    Raises:
        ValueError: no group can be held out, or a class has one frame.
    """
    every = np.arange(len(recording))
    if fraction is None:
        return every, every[:0], ""
    last = last_sessions(recording, fraction)
    if last is not None:
        return every[~last], every[last], "in the last sessions"
    labels = labels_or_zeros(recording)
    if recording.group is not None:
        return *split_groups(labels, recording.group, fraction, 0), UNSEEN_GROUPS
    if by_order:
        return *split(labels, fraction, 0, recording.order), "in the last frames"
    return *split(labels, fraction, 0), "at random"


def labels_or_zeros(recording: Recording) -> np.ndarray:
    """Labels [N] that a model learns; zeros where it learns numbers, labels or not."""
    if recording.labels is None or recording.values is not None:
        return np.zeros(len(recording), np.int64)
    return recording.labels


def why_random(recording: Recording) -> str:
    """Why no session was held out."""
    if recording.session is None:
        return (
            "no sessions are known ({session} in a template, or a column session); "
            "frames recorded together are nearly alike"
        )
    if len(np.unique(recording.session)) < 2:
        return "all frames are of one session"
    return "the last sessions have a class that the others have not"


def last_sessions(recording: Recording, fraction: float) -> np.ndarray | None:
    """Mask [N] of the last sessions; None unless there are several, the first of every class, and
    no group is in both."""
    if recording.session is None:
        return None
    known = np.unique(recording.session)
    if len(known) < 2:
        return None
    count = min(max(1, round(fraction * len(known))), len(known) - 1)
    last = np.isin(recording.session, known[-count:])
    labels = labels_or_zeros(recording)
    if set(labels) - set(labels[~last]):
        return None
    group = recording.group
    if group is not None and set(group[last].tolist()) & set(group[~last].tolist()):
        return None
    return last


def split_groups(
    labels: np.ndarray, group: np.ndarray, fraction: float, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Indices to train on and to hold out, increasing; whole groups [N] are held out.

    In random order, each group that brings what is held out nearer to a `fraction` of each class.
    Of a class for which none does, it is the smallest. Every class keeps a group to train on.

    Raises:
        ValueError: each group is the only one of some class.
    """
    _, class_of = np.unique(labels, return_inverse=True)
    known, group_of = np.unique(group, return_inverse=True)
    frames = np.zeros((len(known), class_of.max() + 1), np.int64)  # of each class
    np.add.at(frames, (group_of, class_of), 1)
    trained = frames.sum(0)
    wanted = fraction * trained
    held = np.zeros(len(known), bool)

    def can_hold(g: int) -> bool:
        inside = frames[g] > 0
        return not held[g] and bool((trained > frames[g])[inside].all())

    def hold(g: int) -> None:
        held[g] = True
        trained[:] -= frames[g]
        wanted[:] -= frames[g]

    drawn = np.random.default_rng(seed).permutation(len(known))
    for g in drawn:
        is_nearer = np.abs(wanted - frames[g]).sum() < np.abs(wanted).sum()
        if is_nearer and can_hold(g):
            hold(g)
    for c in range(frames.shape[1]):
        possible = [g for g in drawn if frames[g, c] and can_hold(g)]
        if possible and not frames[held, c].any():
            hold(min(possible, key=lambda g: frames[g].sum()))
    if not held.any():
        raise ValueError(
            f"group: expected two groups or more of each class, found {len(known)} groups, each "
            "the only one of some class"
        )
    return np.flatnonzero(~held[group_of]), np.flatnonzero(held[group_of])


def split(
    labels: np.ndarray, fraction: float, seed: int, order: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Indices to train on and to hold out, increasing; of each class the same share, at random.

    With the `order` [N] of the frames, the last of each class are held out.

    Raises:
        ValueError: for a class of one frame.
    """
    rng = np.random.default_rng(seed)
    test = []
    for c in np.unique(labels):
        members = np.flatnonzero(labels == c)
        if len(members) < 2:
            raise ValueError(
                "--test-fraction: expected two frames or more of each class, found one"
            )
        held = min(max(1, round(len(members) * fraction)), len(members) - 1)
        if order is None:
            test.append(rng.permutation(members)[:held])
        else:
            in_time = members[np.argsort(order[members], kind="stable")]
            test.append(in_time[-held:])
    chosen = np.sort(np.concatenate(test))
    return np.setdiff1d(np.arange(len(labels)), chosen), chosen
