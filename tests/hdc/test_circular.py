"""Values that go round: learnt by cosine and sine, measured on the circle."""

import numpy as np
import pytest

from hdc import HDCRegressor, circular

DEGREES = np.random.default_rng(0).uniform(-180, 180, 90)


def turned(degrees):
    """A bright bump that goes round a ring of 300 pixels, under noise."""
    places = np.arange(300) * 360 / 300
    bump = 110 + 80 * np.cos(np.deg2rad(places - degrees[:, None]))
    noise = np.random.default_rng(1).integers(0, 20, (len(degrees), 300))
    return (bump + noise).astype(np.uint8).reshape(-1, 15, 20)


def test_errors_go_the_shorter_way_round():
    found, truth = np.array([179.0, 10, 350]), np.array([-178.5, 350, -10])
    assert circular.errors(found, truth, 360).tolist() == [2.5, 20, 0]
    assert circular.errors(found, truth, None).tolist() == [357.5, 340, 360]


def test_a_wrapped_angle_is_predicted_where_it_was_not(tmp_path):
    frames = turned(DEGREES)
    train, test, truth = (frames[:60], DEGREES[:60]), frames[60:], DEGREES[60:]
    plain = HDCRegressor().fit(*train).predict(test)
    model = HDCRegressor(period=np.float32(360)).fit(*train)
    model.save(tmp_path / "m")
    loaded = HDCRegressor.load(tmp_path / "m")
    found = loaded.predict(test)
    assert circular.errors(found, truth, 360).max() < 6
    assert circular.errors(plain, truth, 360).max() > 60
    assert ((found >= 0) & (found <= 360)).all()
    assert model.score(test, truth) > 0.98
    with pytest.raises(ValueError, match=r"^return_interval: expected numbers without"):
        loaded.predict(test, return_interval=True)
    # A sensor that was turned by 30 degrees.
    loaded.recalibrate(frames[:40], DEGREES[:40] + 30)
    assert circular.errors(loaded.predict(test), truth + 30, 360).max() < 15


def test_the_command_declares_advises_and_measures_on_the_circle(hdc, tmp_path):
    archive, model = tmp_path / "ring.npz", tmp_path / "m"
    kept = {"values": DEGREES, "value_names": ["yaw"], "value_units": ["deg"]}
    frames, session = turned(DEGREES), np.arange(90) // 30
    np.savez(archive, frames=frames, session=session, **kept)
    words = ("train", archive, "-o", model, "--test-fraction", 0.3)
    held_out = hdc(*words, "--circular", 360)[1]
    evaluated = hdc("evaluate", model, archive)[1]
    for line in (held_out[2], evaluated[0]):
        assert float(line.split("error ")[1].split(" ")[0]) < 6
