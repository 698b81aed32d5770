"""Every damaged or hostile file ends in a named error or a result, and none crashes or hangs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import fuzz_files
import numpy as np
import pytest
from campaign import KINDS, bomb, damaged, read_case
from fuzz_bombs import BOMBS
from hypothesis import given, settings

HERE = Path(__file__).resolve().parent


def carried_out(*words, script=None):
    """How the process of a campaign ended; what it said is its output."""
    return subprocess.run(
        [sys.executable, script or str(HERE / "campaign.py"), *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=550,
        env={**os.environ, "PYTHONPATH": f"{HERE.parents[1]}:{HERE}"},
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_the_campaign(name):
    done = carried_out(name, 0, 250)
    assert done.returncode == 0, done.stdout[-3000:]


@pytest.mark.slow
@pytest.mark.parametrize("name", BOMBS)
def test_what_asks_for_much_gets_a_result_or_a_refusal_in_time_and_memory(name):
    done = carried_out(name, 0, 1)
    assert done.returncode == 0, done.stdout[-3000:]


@pytest.mark.parametrize("name", KINDS)
def test_a_sample_of_the_campaign(name):
    kind = KINDS[name]
    assert read_case(kind, kind.mend(kind.make()) if kind.mend else kind.make()) == "correct"

    @settings(max_examples=10, deadline=None, database=None)
    @given(damaged(kind))
    def attempt(data):
        assert read_case(kind, data) in ("named", "correct", "changed")

    attempt()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("png: 60,000 × 60,000", r"at most 16777216 pixels .*, found 60000 × 60000"),
        ("png: one row of 4096", "found one that does not decode"),
        ("jpg: a thousand scans", "at most 64 scans, found 1006"),
        ("npz: two million frames", "at most 1048576 frames, found 2097152"),
        ("record: a list of 100,000 levels", "record.json: expected a record in JSON"),
    ],
)
def test_what_asks_for_much_is_refused(name, message):
    with pytest.raises(ValueError, match=message):
        bomb(name)


# The campaign itself finds what it looks for ------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ends", "said"),
    [
        ("import os; os.abort()", "Kind 0"),
        ("import ctypes; ctypes.string_at(0)", "Kind 0"),
        ("while True: pass", "Timeout (0:00:05)!"),
        ("bytearray(10**12)", "MemoryError"),
        ("len(b'x' * 10**9)", "MemoryError: expected at most 1000000000 bytes"),
    ],
)
def test_every_bad_end_of_a_process_is_found(tmp_path, ends, said):
    (tmp_path / "script.py").write_text(
        "import campaign\n"
        f"kind = campaign.Kind('Kind', 'x', lambda: b'abc', lambda _: exec({ends!r}))\n"
        "campaign.KINDS['Kind'], campaign.LIMIT_S = kind, 5\n"
        "campaign.main('Kind', 0, 1)\n"
    )
    done = carried_out(script=str(tmp_path / "script.py"))
    assert done.returncode != 0
    assert said in done.stdout


@pytest.mark.parametrize(
    ("read", "error", "said"),
    [
        (lambda _: int("x"), RuntimeError, "an error that names no file"),
        (lambda _: {}["x"], KeyError, "x"),
        (lambda _: str(np.random.default_rng().random()), RuntimeError, "differs when read again"),
    ],
)
def test_every_bad_end_of_a_reading_is_found(read, error, said):
    with pytest.raises(error, match=said):
        read_case(fuzz_files.Kind("Kind", "x", lambda: b"", read), b"abc")
