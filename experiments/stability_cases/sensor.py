"""The simulated sensor: phases, the elastic layer, touches, the camera, and speckle statistics.

References are mpmath, closed forms of elasticity and of speckle, or the sensor's own numbers
recomputed in float64.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import mpmath
import numpy as np
import torch
from numpy.typing import NDArray
from scipy import ndimage, special, stats
from torch import Tensor

from experiments.stability_cases.case import REFUSAL, Trial, case, refusal
from hdc import HDCClassifier
from scenes.sensor.camera import Camera
from scenes.sensor.check import intensities
from scenes.sensor.configured import scene
from scenes.sensor.contact import ExactPress, Press, Touch
from scenes.sensor.elastomer import Layer, hertz_transform, layer_response
from scenes.sensor.environment import Thermal
from scenes.sensor.scene import SpeckleScene
from scenes.sensor.seeds import stream
from scenes.sensor.sensor import Sensor

Array = NDArray[np.float64]
CPU = torch.device("cpu")
A = 2.45e-3  # m, radius of the robot's contact

# Phases -------------------------------------------------------------------------------------------


def phases(largest: float, side: int) -> Trial:
    """Intensities of one frame from phases of this size, beside cosines and sines by mpmath."""
    camera = Camera(grid=side, crop=side, pupil=side * 2 // 5, unevenness=0)
    drawn = stream(2, "stability").uniform(-largest, largest, camera.path_count)
    mounted = camera.on(CPU)

    def intensity(field: NDArray[Any]) -> NDArray[Any]:
        pupil = np.zeros((2, *camera.disc.shape), field.dtype)
        pupil[:, camera.disc] = field.reshape(2, -1)
        speckle = np.fft.fft2(pupil, (side, side))
        return (np.abs(speckle) ** 2).sum(0) / camera.path_count

    exact = intensity(
        np.array([complex(mpmath.cos(p), mpmath.sin(p)) for p in map(mpmath.mpf, drawn.tolist())])
    )

    def naive() -> NDArray[Any]:
        single = drawn.astype(np.float32)
        return intensity(np.cos(single) + 1j * np.sin(single))

    return Trial(
        naive=naive,
        ours=lambda: mounted.intensity(torch.from_numpy(drawn[None]))[0].numpy(),
        error=lambda found: float(np.abs(found - exact).max()),
    )


PHASES: dict[str, Any] = {
    "expected": "six digits of the mean: float64 phases lose nothing, the transform is in float32",
    "reference": "mpmath, transformed in float64",
    "unit": "of the mean intensity",
    "naive": "phases in float32",
    "ours": "MountedCamera.intensity",
    "tolerance": 1e-5,
    "small": {"side": 32},
}


@case(extreme="phases up to 10^5 rad: float32 keeps 0.004 rad", **PHASES)
def phases_of_a_hundred_thousand_rad(side: int = 256) -> Trial:
    return phases(1e5, side)


@case(extreme="phases up to 10^6 rad: float32 keeps 0.03 rad", **PHASES)
def phases_of_a_million_rad(side: int = 256) -> Trial:
    return phases(1e6, side)


@case(extreme="phases up to 10^8 rad: float32 keeps 4 rad, all of a turn", **PHASES)
def phases_of_a_hundred_million_rad(side: int = 256) -> Trial:
    return phases(1e8, side)


@case(
    extreme="a touch 1.8 mm deep: 6,000 rad for a path that lengthens as much; float32 tables",
    expected="0.01 rad, as the table's float32 is multiplied in float64",
    reference="the same paths with everything in float64",
    unit="rad",
    naive="all of it in float32",
    ours="ExactPress",
    tolerance=0.01,
    small={"pupil": 30},
)
def phases_of_a_deep_touch(pupil: int = 200) -> Trial:
    sensor = Sensor(seed=1, camera=Camera(grid=512, crop=500, pupil=pupil))
    press = Press((28e-3, 8e-3), A, 1.8e-3)
    touch = Touch(1.8e-3, 28e-3, 8e-3)
    paths = sensor.path_set
    double = replace(paths, x=paths.x.double(), y=paths.y.double(), bend=paths.bend.double())
    table = sensor.table(A, torch.float64)
    before = sensor.phase + sensor.sensitivity * 0.2
    change = double.lengthening(table, (touch.x, touch.y)) * sensor.paths.wavenumber * touch.depth
    exact, bound, single = before + change, ExactPress(press, sensor), before.float()
    scale = torch.tensor(sensor.paths.wavenumber * touch.depth, dtype=torch.float32)
    rough = sensor.table(A, torch.float32)
    return Trial(
        naive=lambda: single + paths.lengthening(rough, (touch.x, touch.y)) * scale,
        ours=lambda: before + bound(touch),
        error=lambda found: float((found.double() - exact).abs().max()),
    )


# Elastic layer ------------------------------------------------------------------------------------


def profile(s: Any, big_h: Any, lib: Any) -> Any:
    """P = w̄·U of the layer as the formulas stand: s = kz, H = kh, functions of `lib`."""

    def numerator(x: Any) -> Any:
        sinh, cosh = lib.sinh(big_h), lib.cosh(big_h)
        return big_h * cosh * x * lib.sinh(x) + (cosh + big_h * sinh) * (
            lib.sinh(x) - x * lib.cosh(x)
        )

    stiffness = (lib.sinh(2 * big_h) - 2 * big_h) / (lib.cosh(2 * big_h) + 1 + 2 * big_h**2)
    return stiffness * numerator(s) / numerator(big_h)


def profiles(big_h: Array, share: Array) -> Trial:
    """P at wavenumbers H of a layer of thickness one, at heights that are a share of it."""
    with mpmath.workdps(60):
        exact = np.array([
            float(profile(mpmath.mpf(h) * mpmath.mpf(z), mpmath.mpf(h), mpmath))
            for h, z in zip(big_h.tolist(), share.tolist(), strict=True)
        ])  # fmt: skip

    def naive() -> Array:
        with np.errstate(all="ignore"):
            return profile(big_h * share, big_h, np)

    return Trial(
        naive=naive,
        ours=lambda: layer_response(big_h, share, 1.0)[0],
        error=lambda found: float(np.abs(found / exact - 1).max()),
    )


PROFILE: dict[str, Any] = {
    "reference": "mpmath, 60 digits",
    "unit": "relative",
    "naive": "sinh and cosh as the formula stands",
    "ours": "elastomer.layer_response",
}


@case(
    extreme="kh from 10 to 2000: cosh 2kh overflows above 355",
    expected="10 digits; ∞/∞ is NaN",
    tolerance=1e-10,
    **PROFILE,
)
def a_layer_thick_for_its_waves() -> Trial:
    big_h = np.geomspace(10, 2000, 40)
    return profiles(big_h, 1 - 1 / big_h)  # one over k below the surface


@case(
    extreme="kh from 0.0001 to 0.05: sinh 2kh − 2kh cancels",
    expected="six digits; the formula as it stands keeps eight, its rounding grows as (kh)^-2",
    tolerance=1e-6,
    note="P = O((kh)³) is formed as the half-space's, of order 1, and a difference: the absolute "
    "error is 1e-16, the relative one is worse than that of the plain formula; a displacement "
    "integrates P beside values of order 1 and is not affected: see the next case",
    **PROFILE,
)
def a_layer_thin_for_its_waves() -> Trial:
    big_h = np.geomspace(1e-4, 0.05, 40)
    return profiles(big_h, np.full(40, 0.5))


def trapezoid(layer: Layer, r: Array) -> Array:
    """∫ J0(kr) Φ(ka) w̄(kh) dk up to 200/a by the trapezoidal rule, the formula as it stands."""
    k = np.linspace(1e-9, 200 / A, 20_001)
    big_h = k * layer.thickness
    with np.errstate(all="ignore"):
        surface = (np.sinh(2 * big_h) - 2 * big_h) / (np.cosh(2 * big_h) + 1 + 2 * big_h**2)
    return np.trapezoid(special.j0(np.outer(r, k)) * hertz_transform(k * A) * surface, k)


@case(
    extreme="a layer of 10 µm under a contact of 2.45 mm: ten million times stiffer than silicone",
    expected="w0 = 4h³/(3a⁴)·(1 + 7.2 h²/a²), the lubrication limit, to four digits",
    reference="series of the closed form in h/a",
    unit="relative",
    naive="trapezoidal rule to k = 200/a",
    ours="Layer.compliance",
    tolerance=1e-4,
)
def a_layer_ten_micrometres_thick() -> Trial:
    h, fresh = 1e-5, itertools.count()
    # P = (2/3)H³(1 − 9H²/5 + …) at the surface, and k² acts as −∇² on the pressure √(1 − r²/a²).
    exact = 4 * h**3 / (3 * A**4) * (1 + 7.2 * (h / A) ** 2)
    # A layer keeps what it has computed, so that each call gets one that differs by nothing.
    return Trial(
        naive=lambda: float(trapezoid(Layer(thickness=h), np.zeros(1))[0]),
        ours=lambda: Layer(thickness=h * (1 + 1e-13 * next(fresh))).compliance(A),
        error=lambda w0: abs(w0 / exact - 1),
    )


def hertz(r: Array) -> Array:
    """Surface of a half-space under a Hertz contact, per indentation (Johnson, Eqs. 3.41, 3.42)."""
    outer = np.maximum(r, A)
    tail = (2 * A**2 - outer**2) * np.arcsin(A / outer) + A * np.sqrt(outer**2 - A**2)
    return np.where(r <= A, 1 - r**2 / (2 * A**2), tail / (np.pi * A**2))


@case(
    extreme="a layer of 1 km: the half-space of Hertz and Boussinesq",
    expected="five digits out to 20 contact radii; cosh overflows",
    reference="Hertz's closed form",
    unit="of the indentation",
    naive="trapezoidal rule to k = 200/a",
    ours="Layer.displacement",
    tolerance=1e-5,
)
def a_layer_a_kilometre_thick() -> Trial:
    layer, r = Layer(thickness=1e3), np.array([0.0, 0.5, 1.0, 2.0, 20.0]) * A

    def naive() -> Array:
        surface = trapezoid(layer, r)
        return surface / surface[0]

    return Trial(
        naive=naive,
        ours=lambda: -layer.displacement(r, np.array([1e3]), A)[1][:, 0],
        error=lambda found: float(np.abs(found - hertz(r)).max()),
    )


@case(
    extreme="exactly incompressible (ν = 1/2 is built in): what is pressed in comes out elsewhere",
    expected="no change of volume to 10^-4 of what moves; a half-space lets it go to infinity",
    reference="zero",
    unit="of the volume moved",
    naive="Hertz's half-space for a layer of 5 mm",
    ours="Layer.displacement",
    tolerance=1e-4,
)
def volume_of_the_layer() -> Trial:
    layer, r = Layer(), np.linspace(0, 0.12, 6001)
    return Trial(
        naive=lambda: -hertz(r),
        ours=lambda: layer.displacement(r, np.array([layer.thickness]), A)[1][:, 0],
        error=lambda u: abs(np.trapezoid(u * r, r)) / np.trapezoid(np.abs(u) * r, r),
    )


# Touches ------------------------------------------------------------------------------------------


@case(
    extreme="an indentation of 1 pm: 10^-11 of a path's length",
    expected="five digits; a difference of lengths keeps four of the 16",
    reference="difference of the polylines' lengths, mpmath, 40 digits",
    unit="relative",
    naive="length after − length before, float64",
    ours="PathSet.lengthening",
    tolerance=1e-5,
    small={"pupil": 5},
)
def an_indentation_of_one_picometre(pupil: int = 11, depth: float = 1e-12) -> Trial:
    sensor = Sensor(camera=Camera(grid=16, crop=16, pupil=pupil))
    paths, ends, middle = sensor.path_set, sensor.paths, sensor.layer.thickness / 2
    centre, table = (20e-3, 0.0), sensor.table(A, torch.float64)
    start, stop = [*ends.fibre, middle], [*ends.camera, middle]
    vertices = np.stack(
        [paths.x.numpy(), paths.y.numpy(), sensor.layer.heights[paths.level.numpy()]], axis=-1
    )  # [V, P, 3]
    moved = np.empty_like(vertices)
    for v, vertex in enumerate(vertices):
        offset = vertex[:, :2] - centre
        r = torch.from_numpy(np.hypot(*offset.T))
        outward, down = (u.numpy() for u in table.look_up(r, paths.level[v]))
        moved[v] = depth * np.column_stack([offset * outward[:, None], down])

    def longer(number: Callable[[float], Any], root: Callable[[Any], Any], path: int) -> Any:
        lengths = []
        for step in (0, 1):
            points = [[number(x) for x in start]]
            points += [
                [number(x) + step * number(u) for x, u in zip(vertex, move, strict=True)]
                for vertex, move in zip(
                    vertices[:, path].tolist(), moved[:, path].tolist(), strict=True
                )
            ]
            points.append([number(x) for x in stop])
            legs = itertools.pairwise(points)
            lengths.append(
                sum(root(sum((a - b) ** 2 for a, b in zip(*leg, strict=True))) for leg in legs)
            )
        return lengths[1] - lengths[0]

    with mpmath.workdps(40):
        exact = np.array(
            [float(longer(mpmath.mpf, mpmath.sqrt, path)) for path in range(len(paths))]
        )
    return Trial(
        naive=lambda: np.array([longer(float, math.sqrt, path) for path in range(len(paths))]),
        ours=lambda: paths.lengthening(table, centre).numpy() * depth,
        error=lambda found: float(np.abs(found - exact).max() / np.abs(exact).max()),
    )


@case(
    extreme="an indentation of zero",
    expected="phases unchanged, to the bit",
    reference="the phases without a touch",
    unit="rad",
    naive="float32 phases with and without the touch",
    ours="ExactPress",
    small={"pupil": 30},
)
def no_indentation(pupil: int = 200) -> Trial:
    sensor = Sensor(camera=Camera(grid=512, crop=500, pupil=pupil))
    bound = ExactPress(Press((28e-3, 8e-3), A, 0.0), sensor)
    touch = Touch(0.0, 28e-3, 8e-3)
    before = sensor.phase + sensor.sensitivity * 0.2
    return Trial(
        naive=lambda: before.float() + bound(touch).float(),
        ours=lambda: before + bound(touch),
        error=lambda found: float((found.double() - before).abs().max()),
    )


def pressed(**contact: Any) -> SpeckleScene:
    """A scene of one class, pressed by a robot."""
    classes = {"touched": {"position": (28e-3, 8e-3)}}
    return SpeckleScene(Sensor(), classes, partial(Press, radius=A, **contact))


@case(
    extreme="an indentation of 6 mm into a layer of 5 mm",
    expected="a ValueError that names scene.contact.depth; linear elasticity has no objection",
    reference="a named error",
    unit=REFUSAL,
    naive="depth × displacement",
    ours="SpeckleScene",
)
def deeper_than_the_layer(depth: float = 6e-3) -> Trial:
    layer = Layer()
    return Trial(
        naive=lambda: depth * layer.displacement(np.zeros(1), layer.heights, A)[1],
        ours=lambda: pressed(depth=depth),
        error=refusal("scene.contact.depth"),
    )


@case(
    extreme="depths that vary by 60 %: one in twenty would pull at the layer",
    expected="no negative indentation: a contact that is not glued can only press",
    reference="zero touches",
    unit="of 100 touches",
    naive="depth·(1 + spread·ξ)",
    ours="SpeckleScene.samples",
    note="contact.Press.draw does not bound the depth from below; the largest depth spread in "
    "configs/ is small enough for it not to happen there",
)
def an_indentation_is_never_negative(depth: float = 1e-3, spread: float = 0.6) -> Trial:
    return Trial(
        naive=lambda: depth * (1 + spread * stream(0, "stability").standard_normal(100)),
        ours=lambda: pressed(depth=depth, depth_spread=spread).samples["depth"],
        error=lambda depths: int((depths < 0).sum()),
    )


# Camera -------------------------------------------------------------------------------------------


def stretched(image: Tensor) -> Tensor:
    """An image scaled to its own range, as is usual before it is made 8-bit."""
    return (image - image.min()) / (image.max() - image.min())


@case(
    extreme="one path: a frame without speckle",
    expected="intensity 1 everywhere; an image stretched to its range is 0/0",
    reference="|e^{iφ}|² = 1",
    unit="of the mean intensity",
    naive="stretched to its own range",
    ours="MountedCamera.intensity",
    tolerance=1e-6,
)
def one_path() -> Trial:
    camera = Camera(grid=64, crop=64, pupil=1, polarisations=1, unevenness=0)
    phase = torch.tensor([[123.456]], dtype=torch.float64)
    mounted = camera.on(CPU)
    return Trial(
        naive=lambda: stretched(mounted.intensity(phase)),
        ours=lambda: mounted.intensity(phase),
        error=lambda found: float((found - 1).abs().max()),
    )


@case(
    extreme="two phases fewer than the pupil has pixels",
    expected="an error; a list repeated to the right length makes a wrong speckle in silence",
    reference="an error",
    unit=REFUSAL,
    naive="numpy.resize",
    ours="MountedCamera.intensity",
    note="a sensor draws as many paths as its camera asks for, so no configuration leads here",
)
def fewer_paths_than_pupil_pixels() -> Trial:
    camera = Camera(grid=64, crop=64, pupil=25, unevenness=0)
    mounted = camera.on(CPU)
    phases = torch.from_numpy(stream(0, "stability").uniform(0, 2 * np.pi, camera.path_count - 2))[
        None
    ]
    resized = torch.from_numpy(np.resize(phases.numpy(), (1, camera.path_count)))
    return Trial(
        naive=lambda: mounted.intensity(resized),
        ours=lambda: mounted.intensity(phases),
        error=lambda result: not isinstance(result, Exception),
    )


@case(
    extreme="no light, no read noise",
    expected="zero everywhere; a stretched image is 0/0",
    reference="zero",
    unit="wrong pixels",
    naive="stretched to its own range",
    ours="MountedCamera.expose",
)
def no_light(side: int = 64) -> Trial:
    camera = Camera(grid=side, crop=side, pupil=25, photons=0, read_noise=0, unevenness=0)
    mounted = camera.on(CPU)
    light = torch.ones(1, side, side)
    return Trial(
        naive=lambda: stretched(0 * light),
        ours=lambda: mounted.expose(light, [stream(0, "stability")]),
        error=lambda image: int((image != 0).sum()),
    )


@case(
    extreme="exposed 80 times too long: grey levels up to 10^5",
    expected="255 where the electrons say so; a cast to 8 bits wraps",
    reference="the same Poisson numbers, clipped as integers",
    unit="grey levels",
    naive="round, cast to uint8",
    ours="MountedCamera.expose",
)
def saturation(side: int = 256, photons: float = 3000.0, grey: float = 4000.0) -> Trial:
    camera = Camera(grid=side, crop=side, pupil=80, photons=photons, grey=grey, read_noise=0)
    mounted = camera.on(CPU)
    light = torch.from_numpy(intensities(camera, 1)).float()
    electrons = stream(0, "stability").poisson(light[0].double().numpy() * photons)
    levels = np.rint(electrons * (grey / photons))
    return Trial(
        naive=lambda: levels.astype(np.int64).astype(np.uint8),
        ours=lambda: mounted.expose(light, [stream(0, "stability")])[0].numpy(),
        error=lambda image: float(np.abs(image - np.minimum(levels, 255)).max()),
    )


@case(
    extreme="one photon a pixel, speckle of two polarisations",
    expected="4/9 of the pixels dark (Mandel's formula); Gaussian shot noise is not Poisson's",
    reference="(1 + ⟨n⟩/M)^-M at ⟨n⟩ = 1, M = 2",
    unit="share of dark pixels",
    naive="round(I + √I·ξ)",
    ours="MountedCamera.expose",
    tolerance=0.005,
    small={"frames": 20},
)
def one_photon_a_pixel(frames: int = 60) -> Trial:
    camera = Camera(grid=256, crop=256, pupil=80, unevenness=0, photons=1, grey=1, read_noise=0)
    mounted = camera.on(CPU)
    light = torch.from_numpy(intensities(camera, frames)).float()

    def naive() -> Tensor:
        noise = stream(0, "stability").standard_normal(light.shape, np.float32)
        return (light + light.sqrt() * torch.from_numpy(noise)).round().clamp(0, 255)

    return Trial(
        naive=naive,
        ours=lambda: mounted.expose(light, [stream(0, "stability", i) for i in range(frames)]),
        error=lambda image: abs(float((image == 0).double().mean()) - 4 / 9),
    )


@case(
    extreme="frames of 1 × 1 pixel, from a pupil of one",
    expected="made, learnt (⌊1/2⌋ = 0 ones), and all of one class; standardised they are 0/0",
    reference="the lowest class",
    unit="queries",
    naive="(frame − mean) / std, nearest mean",
    ours="SpeckleScene, HDCClassifier",
)
def frames_of_one_pixel() -> Trial:
    small = {"grid": 1, "crop": 1, "pupil": 1}

    def naive() -> NDArray[Any]:
        made = scene("touch", overrides=[f"sensor.camera.{k}={v}" for k, v in small.items()])
        x = made.frames(range(100)).flatten(1).numpy().astype(float)
        with np.errstate(all="ignore"):
            z = (x - x.mean(1, keepdims=True)) / x.std(1, keepdims=True)
        return np.where(np.isnan(z[:, 0]), -1, 0)  # no class is nearest to NaN

    def ours() -> NDArray[Any]:
        made = scene("touch", overrides=[f"sensor.camera.{k}={v}" for k, v in small.items()])
        frames = made.frames(range(100))
        return HDCClassifier().fit(frames, made.labels[:100]).predict(frames)

    return Trial(naive=naive, ours=ours, error=lambda found: int((found != 0).sum()))


@case(
    extreme="a pupil of 65 pixels on a grid of 64",
    expected="a ValueError that names the pupil; a transform of 64 points crops it in silence",
    reference="a named error",
    unit=REFUSAL,
    naive="numpy.fft.fft2(pupil, (64, 64))",
    ours="Camera",
)
def a_pupil_wider_than_the_grid() -> Trial:
    return Trial(
        naive=lambda: np.fft.fft2(np.ones((65, 65)), (64, 64)),
        ours=lambda: Camera(grid=64, crop=64, pupil=65),
        error=refusal("scene.sensor.camera.pupil", "alias"),
    )


# Speckle statistics -------------------------------------------------------------------------------

SMALLER: dict[str, Any] = {"small": {"frames": 20, "side": 128}}


@case(
    extreme="M = 1 and 2 polarisations",
    expected="contrast 1/√M to 1 %; fields added instead of intensities always give 1",
    reference="1/√M",
    unit="contrast",
    naive="|E_1 + E_2|²",
    ours="Camera",
    tolerance=0.01,
    **SMALLER,
)
def contrast(frames: int = 60, side: int = 256) -> Trial:
    def contrasts(add: Callable[[int], Array]) -> list[float]:
        return [float(i.std() / i.mean()) for i in map(add, (1, 2))]

    def camera(m: int) -> Camera:
        pupil = side * 80 // 256
        return Camera(grid=side, crop=side, pupil=pupil, polarisations=m, unevenness=0)

    def coherent(m: int) -> Array:
        disc = camera(1).disc
        shape = (frames, m, int(disc.sum()))
        pupil = np.zeros((frames, *disc.shape), complex)
        pupil[:, disc] = np.exp(1j * stream(0, "stability").uniform(0, 2 * np.pi, shape)).sum(1)
        return np.abs(np.fft.fft2(pupil, (side, side))) ** 2

    return Trial(
        naive=lambda: contrasts(coherent),
        ours=lambda: contrasts(lambda m: intensities(camera(m), frames)),
        error=lambda c: max(abs(c[0] - 1), abs(c[1] - 1 / math.sqrt(2))),
    )


@case(
    extreme="the whole distribution of the intensity, its tails included",
    expected="a gamma distribution of shape M; a Gaussian of the same moments is negative",
    reference="Gamma(2), scale 1/2",
    unit="Kolmogorov-Smirnov distance",
    naive="1 + ξ/√2",
    ours="Camera",
    tolerance=0.015,
    **SMALLER,
)
def gamma_intensities(frames: int = 60, side: int = 256) -> Trial:
    camera = Camera(grid=side, crop=side, pupil=side * 80 // 256, unevenness=0)
    apart = side // 21  # more than a grain, so that the samples are nearly independent
    count = frames * len(range(0, side, apart)) ** 2
    return Trial(
        naive=lambda: 1 + stream(0, "stability").standard_normal(count) / math.sqrt(2),
        ours=lambda: intensities(camera, frames)[:, ::apart, ::apart].ravel(),
        error=lambda i: float(stats.kstest(i, stats.gamma(2, scale=0.5).cdf).statistic),
    )


@case(
    extreme="lags from 0 to 8 pixels, out to the side lobes",
    expected="|FT of the pupil|² to 0.015; blurred noise of the same width has no side lobes",
    reference="transform of the disc",
    unit="of the variance",
    naive="complex noise, Gaussian blur",
    ours="Camera",
    tolerance=0.015,
    **SMALLER,
)
def autocovariance(frames: int = 60, side: int = 256) -> Trial:
    camera = Camera(grid=side, crop=side, pupil=side * 100 // 256, polarisations=1, unevenness=0)
    pupil = np.zeros((side, side))
    pupil[: camera.pupil, : camera.pupil] = camera.disc
    theory = np.abs(np.fft.ifft2(pupil))[0, :9] ** 2
    theory /= theory[0]
    # A field blurred by e^{−x²/4s²·…} has intensity covariance e^{−x²/2s²}: equal at one pixel.
    width = 1 / math.sqrt(-2 * math.log(theory[1]))

    def covariance(i: Array) -> Array:
        power = np.mean(np.abs(np.fft.fft2(i / i.mean() - 1)) ** 2, 0)
        found = np.fft.ifft2(power).real[0, :9]
        return found / found[0]

    def blurred() -> Array:
        white = stream(0, "stability").standard_normal((2, frames, side, side))
        field = ndimage.gaussian_filter(white, (0, 0, width, width), mode="wrap")
        return covariance((field**2).sum(0))

    return Trial(
        naive=blurred,
        ours=lambda: covariance(intensities(camera, frames)),
        error=lambda found: float(np.abs(found - theory).max()),
    )


@case(
    extreme="a temperature step that leaves 40 % of the field's correlation",
    expected="the intensity keeps the square of it (Siegert), 16 %, to 0.015",
    reference="(E cos SΔT)², S the paths' sensitivities",
    unit="correlation",
    naive="the field's correlation",
    ours="Camera, Thermal",
    tolerance=0.015,
    small={"frames": 6},
)
def siegert_relation(frames: int = 12, step: float = 0.02) -> Trial:
    camera = Camera(grid=256, crop=256, pupil=128, unevenness=0)
    mounted = camera.on(CPU)
    count = frames * camera.path_count
    s = Thermal().draw(count, stream(2, "stability")).reshape(frames, -1)
    start = stream(1, "stability").uniform(0, 2 * np.pi, s.shape)
    field = float(np.mean(np.cos(s * step)))

    def ours() -> float:
        pair = [
            mounted.intensity(torch.from_numpy(p)).numpy().ravel()
            for p in (start, start + s * step)
        ]
        return float(np.corrcoef(pair)[0, 1])

    return Trial(naive=lambda: field, ours=ours, error=lambda found: abs(found - field**2))
