"""The frozen rules of claims: rules.yaml as typed data, its digest, the commit that froze it."""

from __future__ import annotations

import functools
import hashlib
from pathlib import Path
from typing import Any, Literal, TypeVar

import msgspec
from omegaconf import OmegaConf

from experiments.records.files import ROOT

PATH = ROOT / "experiments" / "studies" / "claims" / "rules.yaml"
FROZEN = PATH.with_name("frozen.yaml")

Frames = Literal["captured", "computed", "simulated"]
Status = Literal["exploratory", "confirmatory"]
Read = TypeVar("Read")


class Recording(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A recording that enters.

    Attributes:
        laboratory: the unit across sensors.
        frames: their kind.
        status: whether a model had classified it when the rules were written.
        split: which frames test, as in ``configs/scene/``.
    """

    laboratory: str
    frames: Frames
    status: Status
    split: dict[str, Any]


class Update(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The paper's update after drift: method, p, new frames, and the order in which they are taken,
    that of time."""

    method: str
    p: float
    n_new: int
    order: str


class Runs(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Runs that an order-statistic interval needs; the factor that decides with fewer."""

    least: int
    factor: float


class Claim(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A claim, of the paper or ours.

    Attributes:
        paper, ours: what is claimed, by whom.
        experiment: whose records are the evidence.
        rule: name of what turns numbers into a word.
        decide: kinds of frames that decide, or ``times``.
        form: of HDC.
        sizes: key of the numbers of frames per class.
        rivals: those with a word; the primary ones, if none are named.
        beside: shown without a word.
        recordings: that enter; all, if none are named.
        least_units: laboratories that a word needs.
        samples: of which contrasts are taken.
        update, lost, share: of recalibration.
        levels: shares of flipped bits.
    """

    experiment: str
    rule: str
    decide: tuple[str, ...]
    paper: str = ""
    ours: str = ""
    form: str = "published"
    sizes: str = ""
    rivals: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()
    recordings: tuple[str, ...] = ()
    least_units: int = 1
    samples: str = ""
    update: Update | None = None
    lost: float = 0.0
    share: float = 0.0
    levels: tuple[float, ...] = ()


class Rules(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All of rules.yaml, which says what each is."""

    version: int
    dated: Any
    margin: float
    times: float
    saturated: float
    confidence: float
    few_units: int
    forms: dict[str, str]
    mended: dict[str, Any]
    rivals: tuple[str, ...]
    sizes: dict[str, tuple[int, ...]]
    recordings: dict[str, Recording]
    input_fields: int
    fitted: tuple[str, ...]
    claims: dict[str, Claim]
    ways: tuple[str, ...]
    runs: Runs

    def rivals_of(self, claim: str) -> tuple[str, ...]:
        """The baselines of a claim that have a verdict."""
        return self.claims[claim].rivals or self.rivals


@functools.cache
def rules(path: Path = PATH) -> Rules:
    """The rules; errors as of :func:`read`."""
    return read(path, Rules)


def read(path: Path, kind: type[Read]) -> Read:
    """The rules of a file, of this type.

    Raises:
        ValueError: naming the file and the key that is wrong.
    """
    try:
        return msgspec.convert(_written(path), kind)
    except msgspec.ValidationError as error:
        raise ValueError(f"{path}: {error}") from None


def claim_as_written(name: str) -> dict[str, Any]:
    """The entry of a claim in the file: the keys that stand there, in their order."""
    return dict(_written(PATH)["claims"][name])


def _written(path: Path) -> Any:
    return OmegaConf.to_container(OmegaConf.load(path))


def digest(path: Path = PATH) -> str:
    """SHA-256 of the file of rules, twelve digits."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:12]


@functools.cache
def commit() -> str:
    """The commit that froze the rules, twelve digits; empty where the file was changed since."""
    frozen = _written(FROZEN)
    return str(frozen["commit"])[:12] if frozen["digest"] == digest() else ""
