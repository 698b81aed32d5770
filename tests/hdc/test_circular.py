"""Values that go round: learnt by cosine and sine, measured on the circle."""

import json
import shlex

import numpy as np
import pytest

from hdc import HDCRegressor, circular
from hdc.command.messages import circular_lines
from hdc.readers import open_recording

DEGREES = np.random.default_rng(0).uniform(-180, 180, 90)


def turned(degrees):
    """A bright bump that goes round a ring of 300 pixels, under noise."""
    places = np.arange(300) * 360 / 300
    bump = 110 + 80 * np.cos(np.deg2rad(places - degrees[:, None]))
    noise = np.random.default_rng(1).integers(0, 20, (len(degrees), 300))
    return (bump + noise).astype(np.uint8).reshape(-1, 15, 20)


@pytest.fixture
def archive(tmp_path):
    path = tmp_path / "ring.npz"
    kept = {"values": DEGREES, "value_names": ["yaw"], "value_units": ["deg"]}
    np.savez(path, frames=turned(DEGREES), session=np.arange(90) // 30, **kept)
    return path


def test_errors_go_the_shorter_way_round():
    found, truth = np.array([179.0, 10, 350]), np.array([-178.5, 350, -10])
    assert circular.errors(found, truth, 360).tolist() == [2.5, 20, 0]
    assert circular.errors(found, truth, None).tolist() == [357.5, 340, 360]


@pytest.mark.parametrize(
    ("period", "is_signed"), [(360, True), (360, False), (8, True)]
)
def test_the_plane_gives_values_back(period, is_signed):
    low = -period / 2 if is_signed else 0
    values = np.random.default_rng(0).uniform(low, low + period, (9, 2))
    plane = circular.to_plane(values, period)
    assert plane[:, 0] == pytest.approx(np.cos(2 * np.pi * values[:, 0] / period))
    assert plane[:, 3] == pytest.approx(np.sin(2 * np.pi * values[:, 1] / period))
    assert circular.from_plane(3 * plane, period, is_signed) == pytest.approx(values)


def test_a_wrapped_angle_is_predicted_where_it_was_not(tmp_path):
    frames = turned(DEGREES)
    train, test, truth = (frames[:60], DEGREES[:60]), frames[60:], DEGREES[60:]
    plain = HDCRegressor().fit(*train).predict(test)
    model = HDCRegressor(period=360).fit(*train)
    model.save(tmp_path / "m")
    loaded = HDCRegressor.load(tmp_path / "m")
    found = loaded.predict(test)
    assert circular.errors(found, truth, 360).max() < 6
    assert circular.errors(plain, truth, 360).max() > 60
    assert ((found >= -180) & (found <= 180)).all()
    assert model.score(test, truth) > 0.98
    with pytest.raises(ValueError, match=r"^return_interval: expected numbers without"):
        loaded.predict(test, return_interval=True)
    above = HDCRegressor(period=360).fit(frames[:60], DEGREES[:60] % 360)
    assert above.predict(test) == pytest.approx(found % 360)
    # A sensor that was turned by 30 degrees.
    loaded.recalibrate(frames[:40], DEGREES[:40] + 30)
    assert circular.errors(loaded.predict(test), truth + 30, 360).max() < 15


def test_the_command_declares_advises_and_measures_on_the_circle(
    hdc, archive, tmp_path
):
    model = tmp_path / "m"
    words = ("train", archive, "-o", model, "--test-fraction", 0.3)
    (advised,) = [line for line in hdc(*words)[1] if "--circular 360" in line]
    assert advised.startswith("yaw: -17")
    held_out = hdc(*words, "--circular", 360)[1]
    evaluated = hdc("evaluate", model, archive)[1]
    for line in (held_out[2], evaluated[0]):
        assert float(line.split("error ")[1].split(" ")[0]) < 6
    words = ("compare", archive, "--circular", 360, "--readout", "ridge")
    result = json.loads(hdc(*words, "--json")[1][0])
    assert result["models"]["median, ridge"]["errors"]["yaw"][0] < 6
    line = shlex.split(result["command"])
    assert line[line.index("--circular") + 1] == "360"


@pytest.mark.parametrize(
    ("name", "unit", "low", "high", "is_advised"),
    [
        ("angle", "", 1, 359, True),
        ("torsion", "deg", -178, 179, True),
        ("angle", "", 10, 170, False),  # no whole turn
        ("x", "mm", 1, 359, False),
        ("angle", "", 0, 3000, False),
    ],
)
def test_what_looks_like_a_turn_is_advised(tmp_path, name, unit, low, high, is_advised):
    kept = {"values": np.linspace(low, high, 9), "value_names": [name]}
    np.savez(tmp_path / "v.npz", frames=turned(DEGREES[:9]), value_units=[unit], **kept)
    found = circular_lines(open_recording(tmp_path / "v.npz"))
    assert bool(found) == is_advised
