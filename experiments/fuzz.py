"""A campaign of damaged and hostile files: what became of each, by kind of file and of damage.

Every file is read in a child process (:mod:`experiments.isolate`). Reading has to end in the result
of the sound file, in another one (a flipped pixel is a pixel), or in a ValueError that names the
file; anything else is counted apart, and there should be none of it.

``python -m experiments.run experiment=fuzz`` writes results/measured/fuzz/.
"""

from __future__ import annotations

import functools
import tempfile
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments import fuzz_files, fuzz_records
from experiments.fuzz_bombs import bombs
from experiments.fuzz_damage import DAMAGES
from experiments.fuzz_files import Kind, write
from experiments.fuzz_records import RUN
from experiments.isolate import Outcome, outcomes
from experiments.measurement import Row, measure

FIELD = "field"  # the damage that only files with fields know
BOMB = "bomb"  # no damage: a sound file that asks for much
RESULTS = ("named_errors", "correct", "changed")
FAILURES = ("unnamed_errors", "unstable", "crashes", "hangs")


@dataclass(frozen=True)
class Case:
    """One damaged file, made from these words and numbers alone.

    Attributes:
        kind: place of its kind among :func:`kinds`, or of the bomb among
            :func:`experiments.fuzz_bombs.bombs`.
        damage: name of the way it is damaged.
        seed: of the campaign.
        number: of the case among those of its kind and damage.
        folder: where it may write.
    """

    kind: int
    damage: str
    seed: int
    number: int
    folder: str


def run(cases: int, seed: int, limit_s: float, limit_bytes: float, force: bool = False) -> Path:
    """Carry out the campaign; the task of configs/experiment/fuzz.yaml.

    Args:
        cases: files of each kind and damage.
        seed: of the damages.
        limit_s: after which reading a file counts as hanging.
        limit_bytes: that reading any file should stay below.
        force: also if it was done before.
    """
    config = {
        "_target_": f"{__name__}.run", "cases": cases, "seed": seed, "limit_s": limit_s,
        "limit_bytes": limit_bytes,
    }  # fmt: skip
    compute = functools.partial(campaign, cases, seed, limit_s, limit_bytes)
    return measure("fuzz", config, compute, force=force)


def campaign(
    cases: int, seed: int, limit_s: float, limit_bytes: float, groups: Sequence[str] | None = None
) -> Iterator[Row]:
    """One row for each kind of file and damage, and for each bomb; of these groups, or of all."""
    planned = [
        (kind.group, kind.variant, damage, k, cases)
        for k, kind in enumerate(kinds())
        for damage in (*DAMAGES, *([FIELD] if kind.replace else []))
    ] + [(bomb.group, bomb.name, BOMB, k, 1) for k, bomb in enumerate(bombs())]
    for group, variant, damage, k, n in planned:
        if groups is None or group in groups:
            with tempfile.TemporaryDirectory() as folder:
                arguments = [Case(k, damage, seed, i, folder) for i in range(n)]
                ended = outcomes(read_case, arguments, limit_s, limit_bytes, preload=(__name__,))
                yield row(group, variant, damage, list(ended))


def kinds() -> list[Kind]:
    """Every kind of file that is damaged."""
    return [*fuzz_records.kinds(), *fuzz_files.kinds()]


def damaged(kind: Kind, damage: str, seed: int, number: int) -> bytes:
    """The bytes of a case."""
    words = zlib.crc32(f"{kind.group}, {kind.variant}, {damage}".encode())
    rng = np.random.default_rng([seed, words, number])
    sound = kind.make()
    if damage == FIELD and kind.replace:
        return kind.replace(sound, rng)
    data = DAMAGES[damage](sound, rng)
    return kind.mend(data) if kind.mend else data


def read_case(case: Case) -> str:
    """Read a damaged file twice: ``"correct"``, ``"changed"``, or ``"unstable"`` if they differ.

    Raises:
        ValueError: whatever reading raises, as long as it names the file.
        RuntimeError: if it names it not.
    """
    with tempfile.TemporaryDirectory(dir=case.folder) as folder:
        try:
            return _read(case, Path(folder))
        except ValueError as error:
            if folder in str(error) or RUN in str(error):
                raise
            raise RuntimeError(f"a ValueError that names no file: {error}") from error


def _read(case: Case, folder: Path) -> str:
    if case.damage == BOMB:
        bomb = bombs()[case.kind]
        write(bomb.files(), folder)
        bomb.read(folder)
        return "correct"
    kind = kinds()[case.kind]
    data = damaged(kind, case.damage, case.seed, case.number)
    write({**kind.around(), kind.name: data}, folder)
    first, second = kind.read(folder), kind.read(folder)
    if first != second:
        return "unstable"
    return "correct" if first == _sound(case.kind) else "changed"


@functools.cache
def _sound(kind: int) -> str:
    chosen = kinds()[kind]
    with tempfile.TemporaryDirectory() as folder:
        sound = chosen.make()
        data = chosen.mend(sound) if chosen.mend else sound
        write({**chosen.around(), chosen.name: data}, Path(folder))
        return chosen.read(Path(folder))


def row(group: str, variant: str, damage: str, ended: Sequence[Outcome]) -> Row:
    """What became of the cases of one kind and damage."""
    verdicts = [_verdict(outcome) for outcome in ended]
    counts = Counter(verdicts)
    failed = [
        f"{n}: {outcome.error or verdict} {outcome.message}".strip()[:200]
        for n, (verdict, outcome) in enumerate(zip(verdicts, ended, strict=True))
        if verdict in FAILURES
    ]
    return {
        "kind": group,
        "variant": variant,
        "damage": damage,
        "cases": len(ended),
        **{name: counts[name] for name in (*RESULTS, *FAILURES)},
        "slowest_s": max(outcome.seconds for outcome in ended),
        "peak_bytes": max(outcome.peak_bytes for outcome in ended),
        "first_failures": "; ".join(failed[:3]),
    }


def _verdict(outcome: Outcome) -> str:
    if outcome.kind == "value":
        return str(outcome.value)
    if outcome.kind == "error":
        named = outcome.error in ("ValueError", "BadFrame")
        return "named_errors" if named else "unnamed_errors"
    return {"crash": "crashes", "hang": "hangs"}[outcome.kind]
