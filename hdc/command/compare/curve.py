"""How models learn from ever more frames, and the figure of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hdc.accuracy import wilson
from hdc.command.compare.budget import Budget
from hdc.command.compare.choose import progress
from hdc.selection import Frames, Method

STEPS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
"""Frames per class; of values frames in all, from 5 on."""
_NEAR = 0.8
FORMATS = (".svg", ".pdf", ".png")
# Okabe and Ito's colours, fit for the colour-blind; each with a marker of its own.
_LOOKS = (("#0072B2", "o", "-"), ("#D55E00", "s", "-"), ("#009E73", "^", "--"))
_SIZE = (3.4, 3.0)  # inches: the width of a column


def learning_curve(
    frames: Frames,
    train: np.ndarray,
    test: np.ndarray,
    methods: Sequence[Method],
    draws: int,
    budget: Budget | None = None,
) -> dict[str, list[dict[str, float]]]:
    """Accuracy of each method, or mean error, at each number of training frames.

    A point is the mean over the draws of training frames; a class's interval is Wilson's, a test
    frame counting once with its mean. The last point learns all frames, and is one draw. When the
    budget ends, no further point is added.
    """
    budget = budget or Budget(None)
    sizes = _sizes(frames, train)
    found: dict[str, list[dict[str, float]]] = {method.name: [] for method in methods}
    steps = (draws * (len(sizes) - 1) + 1) * len(methods)
    with progress("Learning curve", steps) as step:
        for size in sizes:
            if budget.is_spent() and size != sizes[0]:
                break
            chosen = [train]
            if size:
                chosen = [_subset(frames, train, size, seed) for seed in range(draws)]
            for method in methods:
                losses = []
                for rows in chosen:
                    answers = method.answers(frames, rows, test)
                    losses.append(frames.losses(answers, test))
                    step()
                point = _point(frames, np.mean(losses, axis=0))
                n_classes = 1 if frames.values is not None else len(frames.names)
                point["frames"] = len(chosen[0]) / n_classes
                found[method.name].append(point)
    return found


def _sizes(frames: Frames, train: np.ndarray) -> list[int]:
    """Frames per class (in all, of values) below the smallest class, then 0 for all."""
    counts = np.unique(frames.labels[train], return_counts=True)[1]
    fewest = 1 if frames.values is None else 5
    most = _NEAR * counts.min()  # beside all frames the next smaller number says little
    return [n for n in STEPS if fewest <= n < most] + [0]


def _subset(frames: Frames, train: np.ndarray, size: int, seed: int) -> np.ndarray:
    """So many frames of each class, increasing."""
    rng = np.random.default_rng([seed, size])
    labels = frames.labels[train]
    members = [rng.permutation(train[labels == c])[:size] for c in np.unique(labels)]
    return np.sort(np.concatenate(members))


def _point(frames: Frames, losses: np.ndarray) -> dict[str, float]:
    if frames.values is not None:
        return {"error": float(losses.mean())}
    right = float((1 - losses).sum())
    low, high = wilson(right, len(losses))
    return {"accuracy": right / len(losses), "low": low, "high": high}


# Figure ------------------------------------------------------------------------------------------


def check_figure(path: Path) -> None:
    """Raise ValueError or FileNotFoundError where no figure can be written."""
    if path.suffix.lower() not in FORMATS:
        listed = ", ".join(FORMATS)
        raise ValueError(f"-o: expected a file of {listed}, found {path}")
    if not path.parent.is_dir():
        raise FileNotFoundError(
            f"-o: expected a folder to save {path.name} in, found none"
        )
    if path.exists() and not path.is_file():
        raise ValueError(f"-o: expected a regular file or none, found {path}")
    import matplotlib  # noqa: F401  (missing: said before the frames are read)


def draw(result: dict[str, Any], path: Path) -> None:
    """Draw the learning curve of a comparison, at the width of a column."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    curves = result["curve"]
    with rc_context({"font.size": 8, "svg.hashsalt": "hdc", "svg.fonttype": "path"}):
        figure = Figure(figsize=_SIZE, layout="constrained")
        axes = figure.add_subplot()
        for (name, points), look in zip(curves.items(), _LOOKS, strict=False):
            _draw_curve(axes, _label(name, result), points, look)
        _draw_chance(axes, result)
        axes.set_xscale("log")
        ticks = sorted(
            {point["frames"] for points in curves.values() for point in points}
        )
        axes.set_xticks(ticks, [f"{tick:.3g}" for tick in ticks])
        axes.minorticks_off()
        axes.set_title(f"Tested on {result['tests'][-1]['name']}", fontsize=8)
        axes.spines[["top", "right"]].set_visible(False)
        figure.legend(loc="outside lower center", ncols=1, frameon=False)
        metadata = {"Date": None} if path.suffix.lower() == ".svg" else None
        figure.savefig(path, dpi=200, metadata=metadata)


def _draw_curve(
    axes: Any,
    label: str,
    points: Sequence[dict[str, float]],
    look: tuple[str, str, str],
) -> None:
    colour, marker, line = look
    x = [point["frames"] for point in points]
    if "error" in points[0]:
        y = [point["error"] for point in points]
    else:
        y = [100 * point["accuracy"] for point in points]
        low = [100 * point["low"] for point in points]
        high = [100 * point["high"] for point in points]
        axes.fill_between(x, low, high, color=colour, alpha=0.12, linewidth=0)
    axes.plot(x, y, line, color=colour, marker=marker, markersize=4, label=label)


def _draw_chance(axes: Any, result: dict[str, Any]) -> None:
    """The level of a guess, and what the axes show."""
    if "classes" in result:
        level, label = 100 * result["tests"][-1]["guess"], "guess of the largest class"
        axes.set_ylim(0, 102)
        axes.set_xlabel("training frames per class")
        axes.set_ylabel("accuracy (%)")
    else:
        level, label = 1.0, "guess of the middle value"
        axes.set_ylim(bottom=0)
        axes.set_xlabel("training frames")
        axes.set_ylabel("mean error / that of a guess")
    axes.axhline(level, color="0.45", linestyle=":", linewidth=1, label=label)


def _label(name: str, result: dict[str, Any]) -> str:
    if name == result["chosen"] and name != result["published"]:
        return f"{name} (chosen)"
    if name == result["published"]:
        word = "published" if "classes" in result else "default"
        return f"{name} ({word})"
    return name
