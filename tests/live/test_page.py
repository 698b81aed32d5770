"""The page in a real browser: pressed, taught, drifted, recalibrated, by two at once."""

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from hdc import HDCClassifier

pytest.importorskip("nicegui", reason="the page needs nicegui: pip install 'hdc[live]'")

CHECKOUT = Path(__file__).resolve().parents[2]
PATIENCE = 60_000  # ms; nothing here takes so long, but on a machine that is busy
PLACES = {"left": (28, -8), "middle": (40, 8), "right": (52, -8)}  # mm


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


@contextlib.contextmanager
def running(folder, *words):
    """The simulated sensor's page in a process of its own; its address."""
    environment = os.environ | {"PYTHONPATH": str(CHECKOUT), "OMP_NUM_THREADS": "1"}
    for name in list(environment):
        if name.startswith(("NICEGUI", "PYTEST")):
            del environment[name]
    command = [sys.executable, "-m", "scenes.live", "--port", str(free_port()), *words]
    with subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True,
    ) as process:  # fmt: skip
        try:
            said = ""
            while not (found := re.search(r"open (http\S+)", said)):
                line = process.stdout.readline()
                assert line, said
                said += line
            yield found[1]
        finally:
            process.send_signal(signal.SIGINT)
            try:
                said = process.communicate(timeout=30)[0]
            except subprocess.TimeoutExpired:
                process.kill()
                raise
    assert "Traceback" not in said, said


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    folder = tmp_path_factory.mktemp("live")
    with running(folder, "--host", "127.0.0.1") as address:
        yield address
    assert list(folder.iterdir()) == []  # nothing is written


class Reader:
    """Somebody who looks at the page."""

    def __init__(self, browser, address, width=1400):
        self.page = browser.new_page(viewport={"width": width, "height": 900})
        self.page.set_default_timeout(PATIENCE)
        self.errors = []
        self.page.on("pageerror", lambda error: self.errors.append(error))
        self.page.goto(address, wait_until="domcontentloaded")
        self.pad = self.page.locator(".pad svg")
        self.pad.wait_for()

    def press(self, name):
        x, y = PLACES[name]
        self.pad.scroll_into_view_if_needed()
        box = self.pad.bounding_box()
        self.page.mouse.click(
            box["x"] + box["width"] * x / 90, box["y"] + box["height"] * (0.5 - y / 40)
        )
        # The picture of the touch comes from the server: it was pressed.
        self.until(f'document.querySelectorAll(\'.pad circle[cx="{x}.00"][fill="#222"]\').length')

    def teach(self, name):
        self.press(name)
        self.page.get_by_label("name of a new class").fill(name)
        self.click("New class")
        self.row(name).get_by_text("10 samples").wait_for()

    def more(self, name, count):
        self.row(name).get_by_label("learn 10 more samples").click()
        self.row(name).get_by_text(f"{count} samples").wait_for()

    def row(self, name):
        return self.page.locator(".class", has=self.page.locator(".name", has_text=name))

    def click(self, button):
        self.page.get_by_role("button", name=button).click()

    def until(self, condition):
        self.page.wait_for_function(condition, timeout=PATIENCE)

    def says(self, answer):
        self.page.locator(".answer", has_text=re.compile(f"^{answer}$")).wait_for()

    def told(self, sentence):
        self.page.get_by_text(sentence).first.wait_for()

    def accuracy(self, condition, fewest=12):
        """Waits for an accuracy on fresh touches, of so many at least."""
        self.until(
            "(() => { const m = document.body.innerText.match(/(\\d+) of the latest (\\d+) right/);"
            f" if (!m || +m[2] < {fewest}) return false; const a = m[1] / m[2];"
            f" return {condition}; }})()"
        )

    def start_anew(self):
        self.click("Back to the first day")
        self.click("Forget everything")
        self.until("document.querySelectorAll('.class').length === 0")
        self.until("document.body.innerText.includes('not tested yet')")


@pytest.fixture
def reader(browser, address):
    reader = Reader(browser, address)
    reader.start_anew()
    yield reader
    assert reader.errors == []
    reader.page.close()


def test_taught_it_is_right_drifted_it_fails_recalibrated_it_is_right_again(reader):
    for name in PLACES:
        reader.teach(name)
    for name in PLACES:
        reader.press(name)
        reader.more(name, 20)
    reader.press("left")
    reader.says("left")
    reader.press("middle")
    reader.says("middle")
    reader.accuracy("a >= 0.8", fewest=20)
    reader.click("Let 16 days pass")
    reader.accuracy("a <= 0.7")
    reader.click("Recalibrate all")
    reader.told("90 samples shown")
    reader.accuracy("a >= 0.75")
    assert reader.page.get_by_text("Simulated sensor").first.is_visible()
    # The picture is alive, and words of the page are within it.
    reader.until("document.querySelector('img.picture').naturalWidth === 500")
    reader.until("document.documentElement.scrollWidth <= 1400")


def test_two_at_once_share_the_sensor_and_a_third_sees_it_on_a_telephone(reader, browser, address):
    other = Reader(browser, address)
    reader.teach("left")
    other.row("left").get_by_text("10 samples").wait_for()
    other.teach("right")
    reader.row("right").get_by_text("10 samples").wait_for()
    reader.press("left")
    other.until('document.querySelectorAll(\'.pad circle[fill="#222"][cx="28.00"]\').length')
    other.row("right").get_by_label("forget").click()
    reader.until("document.querySelectorAll('.class').length === 1")
    small = Reader(browser, address, width=400)
    small.until("document.documentElement.scrollWidth <= 400")
    assert other.errors == small.errors == []
    other.page.close()
    small.page.close()
    reader.more("left", 20)  # who leaves takes nothing along


def test_nonsense_is_a_sentence_and_the_page_goes_on(reader, tmp_path):
    reader.click("New class")
    reader.told("A class needs a name of 1 to")
    reader.click("Recalibrate all")
    reader.told("There is nothing to recalibrate yet")
    reader.click("Save the model")
    reader.told("There is nothing to save yet")
    upload = reader.page.locator("input[type=file]")
    bad = tmp_path / "bad.safetensors"
    bad.write_bytes(b"nonsense")
    upload.set_input_files(bad)
    reader.told("This file is no saved model")
    frames = np.random.default_rng(0).integers(0, 256, (4, 20, 20), np.uint8)
    HDCClassifier().fit(frames, list("aabb")).save(bad)
    upload.set_input_files(bad)
    reader.told("This model is of frames of 20 × 20 pixels; here they have 250 × 250")
    name = "<img src=x>"
    reader.page.get_by_label("name of a new class").fill(name)
    reader.click("New class")
    reader.page.locator(".name", has_text=name).wait_for()
    reader.press("left")


def test_a_model_is_saved_and_loaded(reader, tmp_path):
    reader.teach("left")
    reader.teach("right")
    with reader.page.expect_download(timeout=PATIENCE) as download:
        reader.click("Save the model")
    path = tmp_path / "touch.safetensors"
    download.value.save_as(path)
    assert HDCClassifier.load(path).counts_.tolist() == [10, 10]
    reader.click("Forget everything")
    reader.until("document.querySelectorAll('.class').length === 0")
    reader.page.locator("input[type=file]").set_input_files(path)
    reader.row("right").get_by_text("10 samples").wait_for()
    reader.press("right")
    reader.says("right")


def test_several_places_are_pressed_at_once_and_lifted_again(reader):
    reader.press("left")
    reader.page.get_by_text("several at once").click()
    reader.press("right")
    pressed = "document.querySelectorAll('.pad circle[fill=\"#222\"]').length"
    reader.until(f"{pressed} === 2")
    reader.click("Lift off")
    reader.until(f"{pressed} === 0")


# Without a browser -------------------------------------------------------------------------------


def status(address, **headers):
    try:
        with urllib.request.urlopen(urllib.request.Request(address, headers=headers)) as response:
            return response.status, response.headers.get("Set-Cookie")
    except urllib.error.HTTPError as error:
        return error.code, None


def test_elsewhere_a_token_is_asked_of_everything(address):
    bare = address.split("?")[0]
    assert "?token=" in address
    for path in ("", "stream", "prototype?name=a", "?token=", "?token=wrong", "_nicegui_ws/"):
        assert status(bare + path)[0] == 403, path
    assert status(bare, Cookie="hdc_live=wrong")[0] == 403
    found, cookie = status(address)
    assert found == 200
    assert "HttpOnly" in cookie
    assert status(bare, Cookie=cookie.split(";")[0])[0] == 200
