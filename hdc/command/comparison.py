"""``hdc compare``: read-outs of bits and of grey values on frames of one's own.

Every method sees two matrices of the N frames: Hamming distances of their hypervectors, and inner
products of their grey values. For an L2 penalty a linear model lies in the span of its training
frames, so scikit-learn's estimators solve it exactly from coordinates in that span, and a fit of
120,000 pixels costs no more than one of N coordinates.
"""

from __future__ import annotations

import html
import io
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from sklearn.linear_model import LogisticRegression, RidgeClassifierCV
from sklearn.neighbors import KNeighborsClassifier

import hdc
from hdc import bits
from hdc.accuracy import wilson
from hdc.command.work import last_sessions, split
from hdc.encode import encode
from hdc.readers import Recording
from hdc.readers.files import shown

STEPS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
COLUMNS = 2**13  # pixels made floats at a time
BUSY = 0.5  # load a core, before anything is computed
REPEATED_S = 3.0  # a training is timed again until it took this long, three times at most


class Frames:
    """Frames of both recordings and their two N × N matrices.

    Attributes:
        words: packed hypervectors int64 [N, W].
        distances: Hamming distances [N, N].
        bits: inner products of hypervectors in ±1 [N, N].
        raw, standardised: inner products of grey values in 0 … 1, and of frames each of which is
            scaled to mean 0 and deviation 1.
    """

    def __init__(self, frames: np.ndarray, advance: Callable[[str, int], None]) -> None:
        self.frames, (n, self.pixels) = frames, (len(frames), frames[0].size)
        parts = []
        for start in range(0, n, 32):
            parts.append(encode(torch.from_numpy(frames[start : start + 32]), start))
            advance("Encoding", len(parts[-1]))
        self.words = torch.cat(parts)
        self.distances = np.empty((n, n), np.int64)
        for start in range(0, n, 32):
            part = slice(start, start + 32)
            self.distances[part] = bits.hamming(self.words[part], self.words).numpy()
            advance("Comparing bits", len(self.distances[part]))
        self.bits = (self.pixels - 2 * self.distances).astype(float)
        self.raw, sums = gram(frames, advance)
        deviation = np.sqrt(
            np.maximum(np.diag(self.raw) / self.pixels - (sums / self.pixels) ** 2, 0)
        )
        deviation[deviation == 0] = 1
        centred = self.raw - np.outer(sums, sums) / self.pixels
        self.standardised = centred / np.outer(deviation, deviation)


def gram(
    frames: np.ndarray, advance: Callable[[str, int], None] = lambda *_: None
) -> tuple[np.ndarray, np.ndarray]:
    """Inner products [N, N] of grey values in 0 … 1, and the sum [N] of those of each frame."""
    flat, most = frames.reshape(len(frames), -1), np.float32(np.iinfo(frames.dtype).max)
    products, sums = np.zeros((len(flat), len(flat))), np.zeros(len(flat))
    for start in range(0, flat.shape[1], COLUMNS):
        block = flat[:, start : start + COLUMNS].astype(np.float32) / most
        products += block @ block.T
        sums += block.sum(1, dtype=float)
        advance("Comparing grey values", len(flat) * block.shape[1] / flat.shape[1])
    return products, sums


def coordinates(
    products: np.ndarray, train: np.ndarray, test: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Frames in an orthonormal basis of the span of the centred training frames.

    Centred G = V·S²·Vᵀ gives the training frames V·S, and test frames by their inner products.
    """
    trained, queries = products[np.ix_(train, train)], products[np.ix_(test, train)]
    mean = trained.mean(0)
    centred = trained - mean - mean[:, None] + trained.mean()
    queries = queries - queries.mean(1, keepdims=True) - mean + trained.mean()
    squares, basis = np.linalg.eigh(centred)
    kept = squares > max(squares[-1], 0) * len(trained) * np.finfo(np.float32).eps
    if not kept.any():
        raise ValueError("frames: expected some that differ, found all alike")
    scale = np.sqrt(squares[kept])
    unit = 1 / np.sqrt(
        np.trace(centred) / len(trained)
    )  # so that penalties mean the same everywhere
    return unit * basis[:, kept] * scale, unit * (queries @ basis[:, kept]) / scale


def _prototypes(data: Frames, labels: np.ndarray, train: np.ndarray, test: np.ndarray) -> Any:
    classes = range(labels.max() + 1)
    majorities = [bits.majority(data.words[train[labels[train] == c]]) for c in classes]
    prototypes = torch.stack([torch.atleast_1d(majority) for majority in majorities])
    return bits.hamming(data.words[test], prototypes).argmin(1)


def _neighbours(data: Frames, labels: np.ndarray, train: np.ndarray, test: np.ndarray) -> Any:
    model = KNeighborsClassifier(1, metric="precomputed")
    model.fit(data.distances[np.ix_(train, train)], labels[train])
    return model.predict(data.distances[np.ix_(test, train)])


def _nearest_mean(products: str) -> Callable[..., Any]:
    def predict(data: Frames, labels: np.ndarray, train: np.ndarray, test: np.ndarray) -> Any:
        """|x − m|² but for |x|², of the mean m of each class, by inner products alone."""
        trained, queries = (getattr(data, products)[np.ix_(i, train)] for i in (train, test))
        members = np.eye(labels.max() + 1)[labels[train]]
        weights = members / members.sum(0)
        return (np.sum(weights * (trained @ weights), 0) - 2 * queries @ weights).argmin(1)

    return predict


def _linear(products: str, estimator: Callable[[], Any]) -> Callable[..., Any]:
    def predict(data: Frames, labels: np.ndarray, train: np.ndarray, test: np.ndarray) -> Any:
        trained, queries = coordinates(getattr(data, products), train, test)
        return estimator().fit(trained, labels[train]).predict(queries)

    return predict


def _encoded(frames: np.ndarray) -> torch.Tensor:
    return encode(torch.from_numpy(frames))


def _compared(frames: np.ndarray) -> torch.Tensor:
    return bits.hamming(words := _encoded(frames), words)


def _ridge() -> Any:
    return RidgeClassifierCV(np.logspace(-4, 2, 7))


def _softmax() -> Any:
    return LogisticRegression(C=10, max_iter=1000)


class Method(NamedTuple):
    """How test frames are predicted from training frames, what must be computed of the latter
    before, what the method sees, and how it is set."""

    predict: Callable[[Frames, np.ndarray, np.ndarray, np.ndarray], Any]
    prepare: Callable[[np.ndarray], Any]
    sees: str
    settings: str


def _mean(frames: np.ndarray) -> np.ndarray:
    return frames.mean(0)


_KEPT, _SCALED = "raw", "standardised"
METHODS = {
    "prototypes": Method(
        _prototypes, _encoded, "bits", "bitwise majority, nearest in Hamming distance"
    ),
    "ridge": Method(
        _linear("bits", _ridge), _compared, "bits", "penalty by exact leave-one-out error"
    ),
    "neighbours": Method(_neighbours, _encoded, "bits", "nearest training frame"),
    "mean image": Method(_nearest_mean(_KEPT), _mean, "greys", "nearest class mean"),
    "mean image, standardised": Method(
        _nearest_mean(_SCALED), _mean, "greys", "each frame scaled to mean 0 and deviation 1"
    ),
    "softmax": Method(_linear(_KEPT, _softmax), gram, "greys", "logistic regression, converged"),
    "softmax, standardised": Method(
        _linear(_SCALED, _softmax), gram, "greys", "each frame scaled to mean 0 and deviation 1"
    ),
}
OPTIONS = {
    "prototypes": "hdc train",
    "ridge": "hdc train --readout ridge",
    "neighbours": "hdc train --readout neighbours",
}


def compare(
    recording: Recording, other: Recording | None, path: Path, fraction: float, draws: int
) -> dict[str, Any]:
    """Train and test every method at each number of frames a class.

    Args:
        recording: frames to train on, and to hold out from.
        other: frames of another day to test on, of the same classes; or None.
        path: name of the recording.
        fraction: share of frames to hold out.
        draws: random choices of test frames, and of training frames at each number a class.

    Returns:
        Contents of the table and the page, as JSON has it: a curve for each split and method.
    """
    load = os.getloadavg()[0] / (os.cpu_count() or 1)
    names, n = recording.names, len(recording)
    known = [name for name in recording.classes if name in set(names)]
    names += other.names if other else []
    if unknown := sorted(set(names) - set(known)):
        raise ValueError(f"--test: expected classes among {', '.join(known)}, found {unknown[0]}")
    labels = np.array([known.index(name) for name in names])
    first = [recording[0], *([other[0]] if other else [])]
    if (first[0].shape, first[0].dtype) != (first[-1].shape, first[-1].dtype):
        raise ValueError(
            f"--test: expected frames {first[0].shape} {first[0].dtype} as in the first "
            f"recording, found {first[-1].shape} {first[-1].dtype}"
        )
    frames = np.empty((len(names), *recording.shape), first[0].dtype)
    with _progress(len(names) * 4 + len(METHODS) * (draws + 1) * n) as advance:
        for begin, part in ((0, recording), (n, other)):
            for i, frame in enumerate(part.stream() if part else (), begin):
                frames[i] = frame
                advance("Reading", 1)
        data, splits = Frames(frames, advance), {}
        random = [split(labels[:n], fraction, seed, n) for seed in range(draws)]
        splits["random"] = _curves(data, labels, random, n * draws, advance)
        later = (np.arange(n), np.arange(n, len(names))) if other else _ordered(recording, fraction)
        name = "other recording" if other else "ordered"
        splits[name] = _curves(data, labels, [later] * draws, n, advance)
    seconds = {name: _seconds(name, data, labels, random[0]) for name in METHODS}
    result = {
        "recording": shown(path), "frames": n, "classes": known,
        "shape": list(recording.shape), "test_fraction": fraction, "draws": draws,
        "threads": torch.get_num_threads(), "load": load, "version": hdc.__version__,
        "splits": splits, "training_s": seconds,
    }  # fmt: skip
    return result | {"advice": advice(result)}


def _ordered(recording: Recording, fraction: float) -> tuple[np.ndarray, np.ndarray]:
    """Train on what came first: the first sessions, or the first frames of each class."""
    labels = recording.labels
    assert labels is not None
    if (last := last_sessions(recording, fraction)) is not None:
        return np.flatnonzero(~last), np.flatnonzero(last)
    later = []
    for c in np.unique(labels):
        members = np.flatnonzero(labels == c)
        members = members[np.argsort(recording.order[members], kind="stable")]
        later.append(members[-min(max(1, round(fraction * len(members))), len(members) - 1) :])
    test = np.sort(np.concatenate(later))
    return np.setdiff1d(np.arange(len(labels)), test), test


def _curves(
    data: Frames,
    labels: np.ndarray,
    splits: list[tuple[np.ndarray, np.ndarray]],
    work: int,
    advance: Callable[[str, float], None],
) -> dict[str, Any]:
    """Accuracy of each method at 1, 2, 5 … frames a class and at all, with its Wilson interval.

    A test frame that several draws tested counts once, with the mean of its right answers.
    """
    train = splits[0][0]
    smallest = min(np.bincount(labels[train])[np.unique(labels[train])])
    sizes = [n for n in STEPS if n < smallest] + [0]  # 0: all training frames
    curves: dict[str, Any] = {name: [] for name in METHODS}
    for size in sizes:
        chosen = []
        for seed, (train, test) in enumerate(splits):
            rng = np.random.default_rng([seed, size])
            members = [rng.permutation(train[labels[train] == c]) for c in np.unique(labels[train])]
            chosen.append((np.sort(np.concatenate([m[: size or None] for m in members])), test))
        if size == 0 and all(np.array_equal(train, chosen[0][0]) for train, _ in chosen):
            chosen = chosen[:1]  # of an ordered split there is one choice of all frames
        for name, method in METHODS.items():
            right, tested = np.zeros(len(labels)), np.zeros(len(labels))
            for train, test in chosen:
                right[test] += np.asarray(method.predict(data, labels, train, test)) == labels[test]
                tested[test] += 1
            shares = right[tested > 0] / tested[tested > 0]
            low, high = wilson(shares.sum(), len(shares))
            curves[name].append(
                {"frames_a_class": len(chosen[0][0]) / len(members), "accuracy": shares.mean(),
                 "low": low, "high": high, "tested": len(shares)}
            )  # fmt: skip
            advance(name, work / len(METHODS) / len(sizes) * len(METHODS))
    return curves


def _seconds(
    name: str, data: Frames, labels: np.ndarray, chosen: tuple[np.ndarray, np.ndarray]
) -> float:
    """Seconds to train on frames in memory and predict one: the fastest of several times."""
    train, test = chosen
    method, frames, times = METHODS[name], data.frames[train], list[float]()
    while len(times) < 3 and sum(times) < REPEATED_S:
        begin = time.perf_counter()
        method.prepare(frames)
        method.predict(data, labels, train, test[:1])
        times.append(time.perf_counter() - begin)
    return min(times)


def advice(result: dict[str, Any]) -> str:
    """One sentence: which read-out to use on such frames, and why."""
    name, curves = list(result["splits"].items())[-1]
    last = {method: curve[-1] for method, curve in curves.items()}
    best = max(last, key=lambda method: last[method]["accuracy"])
    on_bits = max(OPTIONS, key=lambda method: last[method]["accuracy"])

    def share(method: str) -> str:
        return f"{method} {last[method]['accuracy']:.0%}"

    def behind(method: str, other: str) -> bool:
        return last[method]["high"] < last[other]["accuracy"]

    where = f"on the {name} test frames"
    if behind(on_bits, best):
        return (
            f"Use {best} on grey values: {where} {share(best)} against {share(on_bits)}, the best "
            "on bits, so the bits lose what tells these classes apart."
        )
    if behind("prototypes", on_bits):
        return (
            f"Use {OPTIONS[on_bits]}: {where} {share(on_bits)} against {share('prototypes')} with "
            "the same bits, so classes have structure that one prototype a class loses."
        )
    if last["prototypes"]["accuracy"] > 0.99 and last[best]["accuracy"] > 0.99:
        return f"Use {OPTIONS['prototypes']}: {where} all are right, so the smallest model will do."
    return (
        f"Use {OPTIONS['prototypes']}: {where} {share('prototypes')} against {share(best)}, no "
        "clear difference, so the smallest model will do."
    )


@contextmanager
def _progress(total: float) -> Iterator[Callable[[str, float], None]]:
    """Called with what is done and how much of the total; a bar while there is a terminal."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(
        *columns, console=console, transient=True, disable=not sys.stderr.isatty()
    ) as bar:
        task = bar.add_task("Reading", total=total)
        yield lambda what, n: bar.update(task, description=what, advance=n)


# For people --------------------------------------------------------------------------------------


def conditions(result: dict[str, Any]) -> str:
    """Frames, split and threads, and whether the cores were busy."""
    height, width = result["shape"]
    text = (
        f"{result['frames']} frames of {len(result['classes'])} classes, {width} × {height} "
        f"pixels, {result['test_fraction']:.0%} held out, {result['draws']} draws, "
        f"{result['threads']} threads"
    )
    if result["load"] > BUSY:
        text += f"; the cores were busy (load {result['load']:.1f} a core): times are too long"
    return text


def text(result: dict[str, Any], width: int | None = 120) -> str:
    """Table, learning curves and advice."""
    splits = result["splits"]
    heads = ["Method", "Sees", *(f"Accuracy, {name}" for name in splits), "Training, s"]
    table = Table(*heads, box=None, pad_edge=False)
    for name, method in METHODS.items():
        last = [curves[name][-1] for curves in splits.values()]
        cells = [f"{p['accuracy']:.1%} [{p['low']:.1%}, {p['high']:.1%}]" for p in last]
        table.add_row(name, method.sees, *cells, f"{result['training_s'][name]:.3g}")
    console = Console(width=width)
    with console.capture() as captured:
        console.print(table)
        for title, curves in splits.items():
            counts = [f"{point['frames_a_class']:.3g}" for point in curves["prototypes"]]
            learning = Table(f"{title}, frames a class", *counts, box=None, pad_edge=False)
            for name, curve in curves.items():
                learning.add_row(name, *(f"{point['accuracy']:.0%}" for point in curve))
            console.print("", learning)
    return f"{conditions(result)}\n\n{captured.get().rstrip()}\n\n{result['advice']}"


PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>hdc compare: {recording}</title>
<style>body {{ margin: 0 auto; padding: 0 16px; max-width: 64rem; font: 16px/1.5 sans-serif; }}
pre {{ overflow-x: auto; font-size: 13px; }} svg {{ max-width: 100%; height: auto; }}</style>
<h1>{recording}</h1><p><b>{advice}</b></p>{curve}<pre>{text}</pre>
<p>Accuracy on frames that were not learnt, with Wilson's 95 % interval over the different frames
tested. Frames held out at random lie between those trained on: if they were recorded in close
succession they are alike, and the ordered split is the one to believe. Training: the fastest of
three, frames in memory. Grey values are scaled to 0 … 1.</p><ul>{methods}</ul>
<p>Made by hdc {version}.</p></html>
"""


def write_page(path: Path, result: dict[str, Any]) -> None:
    """Write a page of HTML that refers to no other file."""
    methods = (f"<li>{name}, on {m.sees}: {m.settings}</li>" for name, m in METHODS.items())
    texts = {key: html.escape(result[key]) for key in ("recording", "advice", "version")}
    page = PAGE.format(
        **texts, text=html.escape(text(result)), curve=_figure(result), methods="".join(methods)
    )
    path.write_text(page, encoding="utf-8")


def _figure(result: dict[str, Any]) -> str:
    """Learning curves of each split as an SVG."""
    with tempfile.TemporaryDirectory() as folder:  # matplotlib would write to the home folder
        os.environ.setdefault("MPLCONFIGDIR", folder)
        from matplotlib import rc_context
        from matplotlib.figure import Figure

        with rc_context({"svg.hashsalt": "hdc compare", "font.size": 8}):
            figure = Figure(figsize=(8, 3.4), layout="constrained")
            panels = figure.subplots(1, len(result["splits"]), sharey=True, squeeze=False)[0]
            for axes, (title, curves) in zip(panels, result["splits"].items(), strict=True):
                for (name, curve), marker in zip(curves.items(), "osD^vPX", strict=True):
                    x = [point["frames_a_class"] for point in curve]
                    y = [100 * point["accuracy"] for point in curve]
                    axes.plot(x, y, marker=marker, markersize=4, linewidth=1.2, label=name)
                axes.set(xscale="log", xlabel="frames a class", title=title)
            panels[0].set_ylabel("test accuracy (%)")
            figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper")
            stream = io.StringIO()
            figure.savefig(stream, format="svg", metadata={"Date": None})
        if os.environ["MPLCONFIGDIR"] == folder:
            del os.environ["MPLCONFIGDIR"]
    return stream.getvalue()[stream.getvalue().index("<svg") :]
