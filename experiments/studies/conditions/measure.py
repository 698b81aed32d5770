"""What would have to be true for Table I: softmax regression, exactly, over what is not stated.

The paper gives the learning rate, 1e-4, and neither the optimiser nor the batch, the initial
weights, the scale of the pixels or where training was stopped. Each is a factor here. Conditions
are chosen on some sensors and reported on others; every row has the accuracy of HDC on the same
frames.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import torch
from rich.console import Console

from experiments.protocol import data, evaluate
from experiments.protocol.scenes import scene_at
from experiments.records.measurement import Row, in_parts, measure
from experiments.reporting import published
from experiments.studies.conditions import linear
from experiments.studies.conditions.linear import Descent, Problem, Products, Start
from experiments.studies.conditions.readings import Curve, Levels, read, report
from hdc import HDCClassifier
from scenes.frames import Scene

NAME = "table1_conditions"
METHODS = ("GD", "SGD")
ROLES = ("choose", "report")


def run(
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    sensors: Mapping[str, Sequence[int]],
    draws: int,
    kinds: Sequence[str],
    pixels: Sequence[str],
    starts: Mapping[str, Mapping[str, Any]],
    methods: Mapping[str, Mapping[str, Any]],
    rate: float,
    reading: Mapping[str, Any],
    interventions: Mapping[str, Any],
    cache: bool = True,
    force: bool = False,
) -> Path:
    """The task of configs/experiment/table1_conditions.yaml: ``measured/table1_conditions-HASH/``.

    Args:
        scene, split: as in the configuration of a run.
        sensors: seeds by role, ``choose`` and ``report``.
        draws: of initial weights for each sensor.
        kinds: of splits.
        pixels: scalings, of ``linear.SCALINGS``.
        starts: arguments of ``linear.Start`` by name, and ``of``: who starts so.
        methods: by name, of :data:`METHODS`: ``batch`` (null: all frames), ``reports_per_epoch``
            and the budget of ``steps``.
        rate: learning rate.
        reading: ``window``, ``plateau_steps`` and ``plateau_fall`` of ``readings.Levels``; the
            other levels are published numbers.
        interventions: what must remove the pattern: of the starts called ``starts``, in the split
            ``kind`` and the scaling ``pixels``, weight ``decay`` and factors ``gain`` on the start,
            and the scaling ``centred`` in place of the other.
        cache: keep made frames.
        force: measure again.

    Returns:
        Path: the folder. Its rows: ``role``, ``seed``, ``split``, ``pixels``, ``method``,
        ``start``, ``draw``, ``intervention``, ``sigma`` (of a weight), the columns of
        ``readings.read``, ``across`` of ``linear.Problem``, ``hdc`` (test accuracy), ``n_train``,
        ``n_test``, ``pixels_in_all``.

    Raises:
        ValueError: naming the key that is wrong.
    """
    console = Console(highlight=False)
    levels = levels_of(reading)
    config = {
        "_target_": f"{__name__}.run",
        "scene": scene,
        "split": split,
        "sensors": sensors,
        "draws": draws,
        "kinds": kinds,
        "pixels": pixels,
        "starts": starts,
        "methods": methods,
        "rate": rate,
        "reading": {**reading, "published": [levels.published, *levels.test]},
        "interventions": interventions,
    }
    check(config)
    settings = {**config, "starts": linear.starts_of(starts, "task.starts"), "levels": levels}

    def compute() -> Iterator[Row]:
        return in_parts(NAME, _parts(config, settings, cache, console), force=force)

    return measure(NAME, config, compute, force=force, console=console)


def levels_of(reading: Mapping[str, Any]) -> Levels:
    """Where curves are read, published numbers included.

    Raises:
        ValueError: naming the key under ``task.reading`` that is wrong.
    """
    known = published.numbers()
    test = known["table1/softmax_test_accuracy"]
    bounds = [x for x in (test.low, test.value, test.high) if x is not None]
    try:
        return Levels(
            published=known["table1/softmax_training_accuracy"].value / 100,
            test=tuple(x / 100 for x in bounds),
            **reading,
        )
    except (TypeError, ValueError) as error:
        raise ValueError(f"task.reading: {error}") from error


def check(config: Mapping[str, Any]) -> None:
    """Refuse what can be known to be wrong before frames are made.

    Raises:
        ValueError: naming the key, what was found and what was expected.
    """
    for key, names, known in (
        ("sensors", config["sensors"], ROLES),
        ("methods", config["methods"], METHODS),
        ("kinds", config["kinds"], ("random", "ordered")),
        ("pixels", config["pixels"], linear.SCALINGS),
        ("interventions.starts", config["interventions"]["starts"], tuple(config["starts"])),
    ):
        if unknown := [name for name in names if name not in known]:
            expected = ", ".join(known)
            raise ValueError(f"task.{key}: expected some of {expected}, found {unknown[0]!r}")
    if not (isinstance(config["draws"], int) and config["draws"] > 0):
        raise ValueError(f"task.draws: expected a positive integer, found {config['draws']!r}")


def _parts(
    config: Mapping[str, Any], settings: Mapping[str, Any], cache: bool, console: Console
) -> Iterator[tuple[Mapping[str, Any], Callable[[], Iterator[Row]]]]:
    """A part is a sensor, a split and a scaling; the frames of a sensor are made once."""
    extra = config["interventions"]
    for role, seeds in config["sensors"].items():
        for seed in seeds:
            sensor = Sensor(config["scene"], seed, config["draws"], cache, console)
            for kind in config["kinds"]:
                centred = [extra["centred"]] if kind == extra["kind"] else []
                for pixels in [*config["pixels"], *centred]:
                    of = {"role": role, "seed": seed, "split": kind, "pixels": pixels}
                    yield {**config, "sensors": {}, **of}, partial(_rows, sensor, of, settings)


class Sensor:
    """The frames of a seed, and their products, made when they are asked for.

    Args:
        scene: configuration.
        seed: of everything.
        draws: of initial weights.
        cache: keep made frames.
        console: shows progress.
    """

    def __init__(
        self, scene: Mapping[str, Any], seed: int, draws: int, cache: bool, console: Console
    ):
        self.seed, self.console = seed, console
        self._how, self._draws = (scene, seed, cache, console), draws
        self._made: tuple[Scene, torch.Tensor, Products] | None = None

    def made(self) -> tuple[Scene, torch.Tensor, Products]:
        """The scene, its frames uint8 [n, H, W], and their products.

        Raises:
            ValueError: for frames of more than 8 bits.
        """
        if self._made is None:
            scene = scene_at(*self._how)
            frames = scene.frames(range(len(scene.labels)))
            if frames.dtype != torch.uint8:
                raise ValueError(f"scene: expected frames of 8 bits a pixel, found {frames.dtype}")
            size = len(scene.classes), frames[0].numel()
            drawn = [linear.draw(self.seed, k, *size) for k in range(self._draws)]
            self._made = scene, frames, linear.products(frames, drawn)
        return self._made


def _rows(sensor: Sensor, of: Row, settings: Mapping[str, Any]) -> Iterator[Row]:
    """The rows of one part."""
    sensor.console.print(f"[dim]{NAME}: {', '.join(map(str, of.values()))}[/dim]")
    scene, frames, known = sensor.made()
    chosen = {**settings["split"], "kind": of["split"]}
    train, test = data.choose(scene, chosen, sensor.seed)
    model = HDCClassifier().fit(frames[train], scene.labels[train])
    right = evaluate.accuracy(model.predict(frames[test]), scene.labels[test])
    here = linear.problem(known, scene.labels, train, test, of["pixels"])
    fixed = {
        "across": here.across,
        "hdc": right,
        "n_train": len(train),
        "n_test": len(test),
        "pixels_in_all": known.pixels,
    }
    cases = list(_cases(of, settings))
    for method, how in settings["methods"].items():
        found = curves(here, cases, settings["levels"], settings["rate"], sensor.seed, **how)
        for (name, start, number, what, _), curve in zip(cases, found, strict=True):
            yield {
                **of,
                "method": method,
                "start": name,
                "draw": number,
                "intervention": what,
                "sigma": start.sigma(known.pixels, here.classes),
                **read(curve, settings["levels"]),
                **fixed,
            }


Case = tuple[str, Start, int, str, float]
"""Name of the start, the start, number of the draw, intervention, weight decay."""


def _cases(of: Row, settings: Mapping[str, Any]) -> Iterator[Case]:
    extra, starts = settings["interventions"], settings["starts"]
    of_interest = [(name, starts[name]) for name in extra["starts"]]
    numbers = range(settings["draws"])
    if of["pixels"] == extra["centred"]:
        for name, start in of_interest:
            yield from ((name, start, k, "centred", 0.0) for k in numbers)
        return
    for name, start in starts.items():
        # There is one start at zero.
        drawn = numbers[:1] if start.rule == "zeros" else numbers
        yield from ((name, start, k, "none", 0.0) for k in drawn)
    if (of["split"], of["pixels"]) == (extra["kind"], extra["pixels"]):
        for name, start in of_interest:
            for k in numbers:
                for decay in extra["decay"]:
                    yield name, start, k, f"decay {decay:g}", float(decay)
                for gain in extra["gain"]:
                    changed = Start(start.rule, start.std, gain)
                    yield name, changed, k, f"gain {gain:g}", 0.0


def curves(
    problem: Problem,
    cases: Sequence[Case],
    levels: Levels,
    rate: float,
    seed: int,
    *,
    batch: int | None,
    reports_per_epoch: int,
    steps: int,
) -> list[Curve]:
    """The learning curves of all cases, trained side by side; each ends where all of it is read.

    Args:
        problem: the frames.
        cases: starts and interventions.
        levels: where curves are read.
        rate: learning rate.
        seed: of the minibatches.
        batch: frames a step; None for all.
        reports_per_epoch: how often in an epoch a curve has a point.
        steps: after which a curve ends in any case.
    """
    n = problem.n_train
    begun = [problem.start(start, number) for _, start, number, _, _ in cases]
    logits = torch.stack([one for one, _ in begun], dim=2)
    to_span = torch.stack([one for _, one in begun], dim=2)
    decay = torch.tensor([one[4] for one in cases], dtype=torch.float64)
    descent = Descent(problem, logits, decay, rate, batch, seed)
    first, _ = report(logits[:n], problem.targets[:n])
    found = [Curve(start) for start in first.tolist()]
    alive = list(range(len(cases)))
    every = max(1, -(-n // (batch or n)) // reports_per_epoch)
    for step, part in zip(range(1, steps + 1), descent.parts(), strict=False):
        descent.step(part)
        if step % every and step != steps:
            continue
        loss, train = report(descent.logits[:n], problem.targets[:n])
        _, test = report(descent.logits[n:], problem.targets[n:])
        shifted = descent.logits[n:] + descent.shrunk * to_span
        _, projected = report(shifted, problem.targets[n:])
        kept = []
        for place, (k, *values) in enumerate(
            zip(alive, *(x.tolist() for x in (loss, train, test, projected)), strict=True)
        ):
            curve = found[k]
            curve.steps.append(step)
            for into, value in zip(
                (curve.loss, curve.train, curve.test, curve.projected), values, strict=True
            ):
                into.append(value)
            if not curve.check(levels):
                kept.append(place)
        if len(kept) < len(alive):
            alive = [alive[place] for place in kept]
            descent.drop(torch.tensor(kept, dtype=torch.int64))
            to_span = to_span[:, :, kept].contiguous()
        if not alive:
            break
    return found
