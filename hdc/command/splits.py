"""Which frames of a recording are learnt and which are tested.

Frames that were recorded together are nearly alike, so whole sessions are tested, else whole
groups, else single frames. Every class that is tested is learnt from other units as well.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hdc.readers import Recording

FOLDS = 5
MOST = 10
"""Sessions or groups that are left out one by one; more are dealt out to the folds."""
NO_SESSIONS = (
    "no sessions are known ({session} in a template, or --sessions NAME of a column); "
    "frames recorded together are nearly alike"
)
Split = tuple[np.ndarray, np.ndarray]
"""Indices of frames to learn and to test, increasing."""


@dataclass(frozen=True)
class Units:
    """Frames that are learnt or tested as a whole.

    Attributes:
        kind: ``"session"``, ``"group"`` or ``"frame"``.
        of: the unit of each frame [N], as numbers that keep the order of the sessions.
        why: why it is no session; empty where it is one, or where groups alone are known.
    """

    kind: str
    of: np.ndarray
    why: str = ""


def _kinds(recording: Recording) -> np.ndarray:
    """The class of each frame [N]; one of frames of numbers."""
    if recording.values is not None:
        return np.zeros(len(recording), np.int64)
    return np.asarray(recording.labels)


def units(recording: Recording, rows: np.ndarray | slice = slice(None)) -> Units:
    """Sessions, if every class of the frames `rows` has two or more; else groups, if known."""
    labels = _kinds(recording)[rows]
    session, group = (
        None if known is None else np.unique(known[rows], return_inverse=True)[1]
        for known in (recording.session, recording.group)
    )
    why = ""
    if session is not None:
        why = _why_no_session(labels, session, group)
        if not why:
            return Units("session", session)
    if group is not None:
        return Units("group", group, why)
    return Units("frame", np.arange(len(labels)), why or NO_SESSIONS)


def _why_no_session(
    labels: np.ndarray, session: np.ndarray, group: np.ndarray | None
) -> str:
    """Why no session can be tested; empty where one can."""
    if _fewest(labels, session) < 2:
        return "a class has frames from one session only"
    if group is not None:
        pairs = np.unique([session, group], axis=1)
        if pairs.shape[1] > len(np.unique(group)):
            return "a group has frames from several sessions"
    return ""


def _fewest(labels: np.ndarray, unit: np.ndarray) -> int:
    """The number of units of the class that has the fewest."""
    return int(_have(labels, unit).sum(axis=1).min())


def _have(labels: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """Whether each of the L different labels has each of the U units: bool [L, U]."""
    _, row = np.unique(labels, return_inverse=True)
    have = np.zeros((row.max() + 1, unit.max() + 1), bool)
    have[row, unit] = True
    return have


# Held out ----------------------------------------------------------------------------------------

HOW = {
    "session": "in the last sessions",
    "group": "in groups that training has not seen",
    "frame": "at random",
}
"""How frames are held out, by the kind of units."""


def hold_out(recording: Recording, fraction: float) -> tuple[Split, Units]:
    """Frames to learn and frames to hold out: of each class a share of its units, at least one.

    The last sessions of each class, or groups or frames at random.

    Raises:
        ValueError: a class has no unit that can be held out, or no other.
    """
    labels, unit = _kinds(recording), units(recording)
    have = _have(labels, unit.of)
    held = np.zeros(have.shape[1], bool)
    left = have.sum(axis=1)  # units of each class to learn
    rng = np.random.default_rng(0)
    for c, row in enumerate(have):
        own = np.flatnonzero(row)
        order = own[::-1] if unit.kind == "session" else rng.permutation(own)
        wanted = min(max(1, round(len(own) * fraction)), len(own) - 1)
        for one in order:
            of = have[:, one]
            if not held[one] and held[own].sum() < wanted and (left[of] > 1).all():
                held[one] = True
                left -= of
        if not held[own].any():
            name = ""
            if recording.values is None:
                name = f" of {recording.classes[np.unique(labels)[c]]}"
            raise ValueError(
                f"--test-fraction: expected a {unit.kind} of each class to test and another to "
                f"learn, found too few{name} (record it again, or let hdc evaluate test another "
                "recording)"
            )
    is_held = held[unit.of]
    return (np.flatnonzero(~is_held), np.flatnonzero(is_held)), unit


# Folds -------------------------------------------------------------------------------------------


def folds(recording: Recording) -> tuple[list[Split], Units]:
    """Splits of all frames, which test each of them once.

    Sessions or groups are left out one by one; of more than :data:`MOST`, and of frames, there are
    five folds with alike shares of each class.

    Raises:
        ValueError: a class has a single frame, or a single group.
    """
    labels, unit = _kinds(recording), units(recording)
    if _fewest(labels, unit.of) < 2:
        raise ValueError(
            f"cross-validation: expected two {unit.kind}s or more of each class, found one"
        )
    return list(_folds(labels, unit)), unit


def _folds(labels: np.ndarray, unit: Units) -> Iterator[Split]:
    from sklearn import model_selection  # late: it takes seconds

    count = min(FOLDS, _fewest(labels, unit.of))
    if unit.kind == "frame":
        made = model_selection.StratifiedKFold(count, shuffle=True, random_state=0)
        return made.split(labels, labels)
    if len(np.unique(unit.of)) > MOST:
        grouped = model_selection.StratifiedGroupKFold(count)
        found = list(grouped.split(labels, labels, unit.of))
        if all(set(labels[train]) == set(labels) for train, _ in found):
            return iter(found)
    return model_selection.LeaveOneGroupOut().split(labels, labels, unit.of)
