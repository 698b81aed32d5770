"""What crashes, hangs or takes too much ends its own process, is counted, and the rest goes on."""

from __future__ import annotations

import math
import os
from pathlib import Path

import pytest

from experiments.isolate import outcomes

PRELOAD = ("experiments.fuzz",)  # one server of children for all tests, with what they need


def test_every_end_of_a_call_is_told_from_the_others():
    code = [
        "pass",
        "raise ValueError('named')",
        "import os; os.abort()",
        "import ctypes; ctypes.string_at(0)",
        "while True: pass",
        "bytearray(10**12)",
        "import os; os._exit(3)",
        "raise SystemExit",
        "pass",
    ]
    found = list(outcomes(exec, code, limit_s=1, limit_bytes=1e9, preload=PRELOAD))
    assert [(o.kind, o.error) for o in found] == [
        ("value", ""),
        ("error", "ValueError"),
        ("crash", "SIGABRT"),
        ("crash", "SIGSEGV"),
        ("hang", "nothing in 1 s"),
        ("error", "MemoryError"),
        ("crash", "exit 3"),
        ("error", "SystemExit"),
        ("value", ""),
    ]
    assert found[1].message == "named"


def test_values_times_and_memory_come_back():
    found = list(outcomes(math.sqrt, [4, 9], limit_s=5, limit_bytes=1e9, preload=PRELOAD))
    assert [o.value for o in found] == [2, 3]
    assert all(0 <= o.seconds < 5 and 1e6 < o.peak_bytes < 1e9 for o in found)
    (large,) = outcomes(exec, ["b'x' * 3 * 10**8"], 5, 1e9, PRELOAD)
    assert large.peak_bytes > found[-1].peak_bytes + 2e8


def test_what_a_call_complains_of_is_not_printed():
    if not Path("/proc/self/fd").exists():
        pytest.skip("this system does not tell where standard error goes")
    (outcome,) = outcomes(os.readlink, ["/proc/self/fd/2"], 5, 1e9, PRELOAD)
    assert outcome.value == os.devnull


def test_a_child_that_is_left_is_ended():
    ends = outcomes(exec, ["pass", "import time; time.sleep(100)"], 200, 1e9, PRELOAD)
    assert next(ends).kind == "value"
    ends.close()
    with pytest.raises(StopIteration):
        next(ends)
