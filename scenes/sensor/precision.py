"""What accuracy costs: error against run time of every knob, run time against size, footprints.

Times are CPU seconds of one thread, the least of several repeats, so that a busy machine does not
show in them.
"""

from __future__ import annotations

import functools
import json
import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch

from scenes.sensor.calibrate import write
from scenes.sensor.camera import Camera
from scenes.sensor.configured import scene
from scenes.sensor.contact import ExactPress, ExpandedPress, Press, Touch
from scenes.sensor.elastomer import Layer
from scenes.sensor.environment import Thermal
from scenes.sensor.seeds import stream
from scenes.sensor.sensor import Sensor

A = 2.45e-3
Line = dict[str, Any]
SCENES = ("touch", "drift", "spatial", "finger", "tactile")


def cpu_time(call: Callable[[], Any], repeats: int = 5) -> float:
    """Least CPU time of one call, in s."""
    call()
    spent = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        spent.append(time.process_time() - start)
    return min(spent)


def table_resolution() -> Iterator[Line]:
    layer = Layer()
    r = stream(0, "precision").uniform(0, 40e-3, 2000)
    exact = layer.displacement(r, layer.heights, A)[1]
    for n in (25, 50, 100, 200, 400, 800):
        table = layer.table(A, n)
        position = r / (r + table.stretch) / table.step
        index = np.minimum(position.astype(int), n - 1)
        powers = (position - index)[:, None] ** np.arange(4)
        found = np.einsum("lrp,rp->rl", table.coefficients[:, index, 4:], powers)

        def make(n: int = n) -> None:
            Layer(thickness=5e-3 * (1 + 1e-9 * time.time())).table(
                A, n
            )  # tables are kept: a new one

        spent = cpu_time(make, 3)
        error = float(np.abs(found - exact).max())
        yield {"knob": "table intervals", "value": n, "error": error, "time_s": spent}


def expansion() -> Iterator[Line]:
    """A robot's touch: constant, first and second order about the target, and exact."""
    sensor = Sensor(seed=1)
    press = Press((28e-3, 8e-3), A, 1.8e-3, 0.01, 0.02e-3)
    exact, bound = ExactPress(press, sensor), ExpandedPress(press, sensor)
    miss = stream(1, "precision").standard_normal((8, 2)) * press.position_spread
    touches = [Touch(1.8e-3, 28e-3 + x, 8e-3 + y) for x, y in miss]
    reference = [exact(t) for t in touches]
    whole = bound._terms
    for order, terms in ((0, 1), (1, 3), (2, 6)):
        bound._terms = whole[:terms]
        square = [(bound(t) - r).square().mean() for t, r in zip(touches, reference, strict=True)]
        spent = cpu_time(lambda: bound(touches[0]))
        error = math.sqrt(float(np.mean(square)))
        yield {"knob": "order of expansion", "value": order, "error": error, "time_s": spent}
    yield {"knob": "order of expansion", "value": "exact", "error": 0.0,
           "time_s": cpu_time(lambda: exact(touches[0]))}  # fmt: skip


def phase_precision() -> Iterator[Line]:
    """Error of the field e^{iφ} as complex64, for phases of 10⁵ rad and 10, 100 times more.

    The reference has the 64-bit mantissa of ``numpy.longdouble``.
    """

    def single(phase: torch.Tensor) -> torch.Tensor:
        p = phase.to(torch.float32)
        return torch.complex(p.cos(), p.sin())

    def mixed(phase: torch.Tensor) -> torch.Tensor:
        turns = phase * (1 / (2 * math.pi))
        p = (turns - turns.floor()).mul_(2 * math.pi).to(torch.float32)
        return torch.complex(p.cos(), p.sin())

    def double(phase: torch.Tensor) -> torch.Tensor:
        return torch.complex(phase.cos().to(torch.float32), phase.sin().to(torch.float32))

    for longer in (1, 10, 100):
        phase = torch.from_numpy(stream(2, "precision").uniform(-1e5, 1e5, 62_856)) * longer
        long = phase.numpy().astype(np.longdouble)
        real, imaginary = np.cos(long), np.sin(long)
        for name, way in (("float32", single), ("mixed", mixed), ("float64", double)):
            field = way(phase).numpy()
            square = (field.real - real) ** 2 + (field.imag - imaginary) ** 2
            yield {"knob": f"phases of {longer * 10**5:.0e} rad", "value": name,
                   "error": float(np.sqrt(square.mean())),
                   "time_s": cpu_time(functools.partial(way, phase))}  # fmt: skip


def path_count() -> Iterator[Line]:
    """Spread over sensors of a frame's correlation after a 0.1 K step: falls with √paths."""
    for pupil in (25, 50, 100, 200):
        camera = Camera(pupil=pupil, unevenness=0)
        mounted = camera.on(torch.device("cpu"))
        found = []
        for i in range(12):
            start = stream(i, "precision").uniform(0, 2 * np.pi, camera.path_count)
            s = Thermal().draw(camera.path_count, stream(i, "thermal"))
            both = mounted.intensity(torch.from_numpy(np.stack([start, start + 0.1 * s])))
            found.append(float(np.corrcoef(both.reshape(2, -1).numpy())[0, 1]))
        phases = torch.from_numpy(start[None])
        yield {"knob": "paths", "value": camera.path_count, "error": float(np.std(found, ddof=1)),
               "time_s": cpu_time(lambda m=mounted, p=phases: m.intensity(p))}  # type: ignore[misc]  # fmt: skip


def sizes() -> Iterator[Line]:
    """CPU time a frame against paths, vertices and pixels."""
    for pupil in (50, 100, 200, 400):
        made = scene("touch", 0, 0, [f"sensor.camera.pupil={pupil}"])
        touched = [int(np.flatnonzero(made.labels == 0)[0])]
        value = made.sensor.camera.path_count
        yield {"knob": "size: paths, touch", "value": value, "error": "",
               "time_s": cpu_time(lambda m=made, t=touched: m.frames(t))}  # type: ignore[misc]  # fmt: skip
    for vertices in (3, 6, 12, 24):
        made = scene("finger", 0, 0, [f"sensor.paths.vertices={vertices}"])
        touched = [int(np.flatnonzero(made.labels == 0)[0])]
        yield {"knob": "size: vertices, finger", "value": vertices, "error": "",
               "time_s": cpu_time(lambda m=made, t=touched: m.frames(t))}  # type: ignore[misc]  # fmt: skip
    for grid in (256, 512, 1024, 2048):
        shape = [f"sensor.camera.{k}={v}" for k, v in (("grid", grid), ("crop", grid - 12))]
        made = scene("touch", 0, 0, shape)
        touched = [int(np.flatnonzero(made.labels == 0)[0])]
        yield {"knob": "size: pixels, touch", "value": (grid - 12) ** 2, "error": "",
               "time_s": cpu_time(lambda m=made, t=touched: m.frames(t))}  # type: ignore[misc]  # fmt: skip


def footprint(name: str) -> Line:
    """One scene in a process of its own: modules, peak memory above torch's, time a frame."""
    program = f"""
import json, sys, time
import torch, numpy, scipy.special, hydra.utils, omegaconf
torch.set_num_threads(1)
now = time.process_time
def peak():  # of this process alone; getrusage would count its parent's
    return int(open("/proc/self/status").read().split("VmHWM:")[1].split()[0]) / 1024
from scenes.sensor.configured import scene
bare, start = peak(), now()
made = scene({name!r})
made.frames([0])
built = now() - start
made.frames(range(60))
spent = []
for _ in range(7):
    start = now()
    made.frames(range(20))
    spent.append((now() - start) / 20)
parts = sorted(m.rsplit(".", 1)[1] for m in sys.modules if m.startswith("scenes.sensor."))
print(json.dumps([built, min(spent), peak() - bare, bare, parts]))
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    built, spent, extra, bare, parts = json.loads(done.stdout)
    return {
        "scene": name,
        "first_frame_s": f"{built:.3f}",
        "frame_ms": f"{1e3 * spent:.2f}",
        "peak_above_imports_mib": f"{extra:.0f}",
        "imports_mib": f"{bare:.0f}",
        "parts": " ".join(p for p in parts if p not in ("configured", "validate", "seeds")),
        "command": "python -m scenes.sensor.check",
    }


def report(folder: Path) -> None:
    """Write sensor_precision.csv, its figure and sensor_footprint.csv."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        knobs = (table_resolution, expansion, phase_precision, path_count, sizes)
        lines = [line for knob in knobs for line in knob()]
    finally:
        torch.set_num_threads(before)
    for line in lines:
        line["command"] = "python -m scenes.sensor.check"
        knob, error = line["knob"], f"{line['error']:.3g}" if line["error"] != "" else ""
        print(f"{knob:24} {line['value']!s:>10} {error:>10} {line['time_s']:.3g} s")
    write(folder / "sensor_precision.csv", lines)
    for name in {str(line["knob"]) for line in lines if str(line["knob"]).startswith("size")}:
        x, t = zip(*((p["value"], p["time_s"]) for p in lines if p["knob"] == name), strict=True)
        print(f"{name}: time grows as size^{np.polyfit(np.log(x), np.log(t), 1)[0]:.2f}")
    footprints = [footprint(name) for name in SCENES]
    write(folder / "sensor_footprint.csv", footprints)
    for line in footprints:
        print(" ".join(f"{key}={line[key]}" for key in list(line)[:-1]))
    figure(lines, folder / "figures" / "sensor_precision.svg")


PANELS = (
    ("displacement table", "table intervals", "largest error (of the indentation)"),
    ("repeated touch", "order of expansion", "phase error, rms (rad)"),
    ("precision of phases", "phases of", "field error, rms"),
    ("number of paths", "paths", "spread of a correlation"),
)


def figure(lines: list[Line], path: Path) -> None:
    """Error against CPU time, one panel a knob."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt
    from matplotlib import ticker

    fig, axes = plt.subplots(2, 2, figsize=(8.4, 6.2), layout="constrained")
    for axis, (title, knob, error) in zip(axes.flat, PANELS, strict=True):
        names = dict.fromkeys(str(p["knob"]) for p in lines if str(p["knob"]).startswith(knob))
        for row, name in enumerate(names):
            mine = [p for p in lines if p["knob"] == name and p["error"] not in ("", 0.0)]
            x, y = [1e3 * p["time_s"] for p in mine], [p["error"] for p in mine]
            style = "o" if len(names) > 1 else "o-"
            axis.loglog(x, y, style, label=name, markersize=5)
            for p in mine:
                if row == len(names) - 1:
                    place = (1e3 * p["time_s"], p["error"])
                    axis.annotate(str(p["value"]), place, (5, 5), textcoords="offset points",
                                  fontsize=8)  # fmt: skip
        if len(names) > 1:
            axis.legend(fontsize=8, loc="center right")
        axis.set_title(title, fontsize=10)
        axis.set_xlabel("CPU time (ms)", fontsize=9)
        axis.set_ylabel(error, fontsize=9)
        axis.margins(x=0.25, y=0.15)
        narrow = [axis.xaxis] if knob == "phases of" else [axis.xaxis, axis.yaxis]
        for ticks in narrow:  # less than two decades: 1, 2, 5 as plain numbers
            ticks.set_major_locator(ticker.LogLocator(subs=(1, 2, 5)))
            ticks.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))
            ticks.set_minor_formatter(ticker.NullFormatter())
        axis.grid(alpha=0.3, which="major")
    path.parent.mkdir(parents=True, exist_ok=True)
    fig.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)
    plt.close(fig)
