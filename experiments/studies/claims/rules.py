"""Rules from version 4 on, as their file has them: claims, recordings, margins and draws."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import msgspec
import yaml

RULES = Path(__file__).with_name("rules_4.yaml")
LARGEST: Final = "largest"
TRAINED: Final = "as trained"
Size = int | Literal["largest", "as trained"]
Models = Annotated[tuple[str, ...], msgspec.Meta(max_length=6)]


class Strict(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base class of the parts of a file, of which every key is known."""


class Asked(Strict, frozen=True, kw_only=True):
    """A claim or a choice, and its evidence.

    Attributes:
        says, by: what is claimed, by whom.
        experiment: whose lines are the evidence.
    """

    says: str
    by: str
    experiment: str


class Recording(Strict, frozen=True):
    """A recording that enters.

    Attributes:
        source: the unit of the number across recordings.
        status: exploratory where numbers on it were known when the rules were written;
            confirmatory where no model had classified its frames.
        split: the kind of its split.
        sizes: that its classes fill; all if none are named.
        groups: how many there are of a class, if fewer than draws.
    """

    source: str
    status: Literal["exploratory", "confirmatory"]
    split: Literal["grouped", "leave_group_out", "ordered", "session"]
    sizes: tuple[Size, ...] = ()
    groups: int | None = None


class Claim(Asked, frozen=True):
    """A claim: `form` loses less than the margin to `rival`.

    Attributes:
        form, ``rival``: models; the same where `of_form` and `of_rival` tell them apart.
        split: column with the kind of split; lines of another than the recording's do not count.
        of_form, of_rival: values of columns that the lines of the form have, and the lines of the
            ``rival``.
        recordings: that enter; all if none are named.
        sizes: training frames of a class; the sizes of the rules if none are named; ``as trained``
            if the experiment has one size.
        draws: of a recording, if fewer than the rules have.
        right, asked: columns with right answers, and with test frames.
        rival_right, rival_asked: the same of the ``rival``, if they are others.
    """

    form: str
    rival: str
    split: str = ""
    of_form: dict[str, Any] = {}
    of_rival: dict[str, Any] = {}
    recordings: tuple[str, ...] = ()
    sizes: tuple[Size, ...] = ()
    draws: int | None = None
    right: str = "right"
    asked: str = "n_test"
    rival_right: str = ""
    rival_asked: str = ""


class Times(Asked, frozen=True):
    """A claim: the training of `model` takes at least so many times as long as HDC's.

    Attributes:
        experiment: whose lines are the evidence: a line per fit, with ``fit_s`` and with the reason
            why it was ``disturbed``, or "".
        model, over: models.
        at_least: ratio of training times.
        threads: of both.
        fits: undisturbed ones of each model that a measurement needs.
        measurements: records that count, the first so many; they were made hours apart.
    """

    model: str
    over: str
    at_least: float
    threads: int
    fits: int
    measurements: int


class Choice(Asked, frozen=True):
    """Which of some forms is used: the first that is at most the margin below the best.

    Attributes:
        split: as in :class:`Claim`.
        among: models, the simplest first.
        recordings: that enter.
        size: training frames of a class.
    """

    split: str
    among: Models
    recordings: tuple[str, ...]
    size: Size

    def against_the_first(self, form: str) -> Claim:
        """A form and the simplest one, as a claim has them."""
        return Claim(
            says=self.says,
            by=self.by,
            experiment=self.experiment,
            split=self.split,
            form=form,
            rival=self.among[0],
            recordings=self.recordings,
        )


class Prior(Strict, frozen=True):
    """The hierarchical model of differences of sources, as shares of accuracy.

    Attributes:
        freedom: degrees of freedom of Student's t within a source.
        mean: standard deviation of the normal prior of the mean over sources.
        between: scale of the half-normal prior of the standard deviation between sources.
    """

    freedom: int
    mean: float
    between: float


class Rules(Strict, frozen=True):
    """A file of rules.

    Attributes:
        version, dated: which, and when they were fixed.
        margin: the loss of accuracy that counts as none.
        sure: probability of a yes; its complement is that of a no.
        sizes: training frames of a class, each of which gets a word.
        draws: of a recording, as many as count; later ones do not.
        shared: test frames over training frames of a draw. Draws share frames, so that the variance
            of their mean is that of one times 1/draws + shared (Nadeau and Bengio, Mach. Learn. 52,
            239 (2003)).
        prior: the model that joins sources.
        candidates: models from which each family chooses its form, for those who train them.
        recordings, claims, times, choices: by name.
    """

    version: int
    dated: datetime.date
    margin: float
    sure: float
    sizes: tuple[Size, ...]
    draws: int
    shared: float
    prior: Prior
    candidates: dict[str, Models]
    recordings: dict[str, Recording]
    claims: dict[str, Claim]
    times: dict[str, Times] = {}
    choices: dict[str, Choice] = {}


def read(path: Path) -> Rules:
    """The rules of a file.

    Raises:
        ValueError: naming the file and the key that is wrong.
    """
    try:
        return msgspec.convert(yaml.safe_load(path.read_text("utf-8")), Rules)
    except msgspec.ValidationError as error:
        raise ValueError(f"{path}: {error}") from None
