"""A page that shows a model trained before: classes with their distances, or values."""

import asyncio
import shlex
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest

from hdc import HDCClassifier, HDCRegressor
from hdc.command import main

pytest.importorskip(
    "nicegui", reason="the page needs nicegui: pip install 'speckle-hdc[live]'"
)

from nicegui.testing import user_simulation

from hdc.live import Film, Recorded
from hdc.live import page as pages
from hdc.live.session import Answer, Session
from hdc.live.worker import Worker
from hdc.readers import Window
from scenes.live import SimulatedSensor
from scenes.pressed import PressedPage, PressedSession

N = 12


@pytest.fixture
def frames():
    """uint8 [24, 32, 40]: twelve frames of each of two patterns, which moves along."""
    rng = np.random.default_rng(0)
    base = rng.integers(0, 180, (2, 32, 40))
    noise = rng.integers(0, 70, (2, N, 32, 40))
    return (base[:, None] + noise).astype(np.uint8).reshape(2 * N, 32, 40)


@pytest.fixture
def film(write_film, tmp_path, frames):
    write_film(tmp_path / "v.mkv", frames)
    return tmp_path / "v.mkv"


@pytest.fixture
def classifier(frames):
    return HDCClassifier().fit(frames, np.repeat(["left", "right"], N))


@pytest.fixture
def regressor(frames):
    return HDCRegressor().fit(frames, np.repeat([1.0, 3.0], N) + np.tile([0, 0.1], N))


def test_a_video_is_played_over_and_over(film, frames):
    source = Film(film, Window(crop=(0, 0, 20, 32)))
    assert (source.shape, source.label) == ((32, 20), None)
    seen = [source.frame() for _ in range(48)]
    assert (seen[23] == seen[47]).all()  # the first was looked at for its size
    assert np.abs(seen[0].astype(int) - frames[1][:, :20]).max() <= 5
    assert len(source.samples(30)) == 30


def test_a_trained_model_answers_and_is_not_taught(film, frames, classifier):
    session = Session(Film(film, Window()), classifier)
    assert session.counts == {"left": N, "right": N}
    for label in np.repeat(["left", "right"], N)[1:]:
        _, _, answer, seconds = session.look()
        assert answer.label in (label, None)
        assert min(answer.distances, key=answer.distances.get) == label
        assert 0 < seconds < 10
    session.model.predict_set = lambda frames, alpha: [np.array([])]
    answer = session.ask(session.source.frame())
    assert (answer.label, answer.likely) == (None, ())  # no label beside an empty set
    frame = session.source.frame()
    distances = classifier.distances(frame[None])[0] / frame.size
    margin = np.diff(sorted(distances)).item()
    assert session.ask(frame).margin == pytest.approx(margin)
    for job in (
        lambda: session.learn("left", 1),
        lambda: session.forget(None),
        lambda: session.recalibrate("left", 1, 0.5),
    ):
        with pytest.raises(ValueError, match="trained before and is shown as it is"):
            job()
    assert session.model is classifier
    assert session.counts == {"left": N, "right": N}


def test_values_of_a_trained_regressor_are_shown(film, regressor):
    session = Session(Film(film, Window()), regressor)
    answer = session.look()[2]
    ((value, low, high),) = answer.values
    assert low <= value <= high
    assert value == pytest.approx(1.05, abs=0.3)
    assert pages._in_words(answer) == (f"{value:.1f} [{low:.1f}, {high:.1f}]", "")
    assert pages._in_numbers(answer, 0.0123) == "12.3 ms"
    assert pages._in_words(Answer("a", ("a",))) == ("a", "95% prediction set: a.")
    answer = Answer("a", ("a",), {"a": 0.25, "b": 0.4})
    assert pages._in_numbers(answer, 0.002) == "distance 0.250 · margin 0.150 · 2.0 ms"
    assert Answer("a", ("a",), {"a": 0.25}).margin is None


def test_angles_are_shown_without_an_interval(film, frames):
    angles = np.repeat([10.0, 200.0], N)
    session = Session(
        Film(film, Window()), HDCRegressor(period=360).fit(frames, angles)
    )
    ((angle,),) = session.look()[2].values
    assert pages._in_words(Answer(values=((angle,),))) == (f"{angle:.1f}", "")


def shown(session, words, page=pages.Page):
    """Open the page without a browser, until it shows the words."""

    async def look():
        worker = Worker(session)
        worker.start()
        async with user_simulation(lambda: page(worker)) as user:
            await user.open("/")
            for word in words:
                worker.picture()  # as the browser asks for it
                await user.should_see(word, retries=100)
        worker.stop()

    with ThreadPoolExecutor(
        1
    ) as thread:  # playwright has an event loop of its own here
        thread.submit(asyncio.run, look()).result()


def test_the_page_shows_a_trained_classifier(film, classifier):
    words = ["What it was trained on", "12 samples", "distance 0.", "margin 0.", " ms"]
    shown(Session(Film(film, Window()), classifier), words)


def test_the_page_shows_a_trained_regressor(film, regressor):
    session = Session(Film(film, Window()), regressor)
    shown(session, ["Numbers; each is shown", "[", " ms"])


def test_the_page_of_the_simulated_sensor_is_pressed_and_drifts():
    words = ["The silicone from above", "Let 16 days pass", "new touches", "Press some"]
    shown(PressedSession(SimulatedSensor(side=60)), words, PressedPage)


def test_the_page_teaches_a_recording(tmp_path, frames):
    np.savez(tmp_path / "r.npz", frames=frames, labels=np.repeat(["a", "b"], N))
    source = Recorded(tmp_path / "r.npz", Window())
    shown(Session(source), ["nothing yet: teach it two classes", "recorded as “a”"])


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["m", "--video", "v.mkv", "--subsample", "2"], 2, "no --crop or --subsample"),
        (
            ["--video", "v.mkv", "--camera", "0"],
            2,
            "expected one of --camera, --folder",
        ),
        (["x", "--video", "v.mkv"], 1, "expected a saved model, found"),
        (["m", "--video", "w.mkv"], 1, "w.mkv: expected"),
        (
            ["m", "--folder", "r.npz"],
            1,
            "r.npz: expected 40 × 32 pixels as in training",
        ),
        (["--folder", "s.npz"], 1, "s.npz: expected images with labels, found"),
        (
            ["--video", "v.mkv", "--labels", "kind"],
            2,
            "expected no --labels without --folder",
        ),
    ],
)
def test_what_does_not_fit_is_one_line(
    film, frames, classifier, tmp_path, monkeypatch, capfd, words, code, message
):
    monkeypatch.chdir(tmp_path)
    classifier.save("m")
    (tmp_path / "x").write_text("no model")
    np.savez("r.npz", frames=frames[:, :20], labels=np.repeat([0, 1], N))
    np.savez("s.npz", frames=frames[:, 0], labels=np.repeat([0, 1], N))
    with pytest.raises(SystemExit) as caught:
        main(["live", *words])
    out, err = capfd.readouterr()
    assert (caught.value.code, out, len(err.splitlines())) == (code, "", 1)
    assert message in err


def test_the_advice_for_an_ambiguous_folder_works(frames, tmp_path, monkeypatch, capfd):
    for number, frame in enumerate(frames):
        image = tmp_path / f"day{number % 2}" / "ab"[number // N] / f"{number}.png"
        image.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(image), frame)
    with pytest.raises(SystemExit):
        main(["live", "--folder", str(tmp_path)])
    *_, advice = capfd.readouterr().err.split("; or ")
    served = []
    monkeypatch.setattr(
        pages, "serve", lambda session, *_: served.append(session.source)
    )
    with pytest.raises(SystemExit):
        main(["live", "--folder", str(tmp_path), *shlex.split(advice)])
    assert capfd.readouterr().err == ""
    assert served[0].classes == ("a", "b")
