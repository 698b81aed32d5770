"""README.md is filled from results; what is missing shows as missing."""

import re

import pytest

from experiments import readme, reproduce
from experiments.record import ROOT


def test_every_block_of_the_readme_has_a_source_and_says_what_is_missing(tmp_path):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    filled = readme.fill(text, readme.sources(tmp_path))
    blocks = re.findall(r"<!-- begin (\w+) -->\n(.*)\n<!-- end \1 -->", filled)
    assert {name for name, _ in blocks} == set(readme.sources(tmp_path))
    assert all(line.startswith("*missing: ") for _, line in blocks)


def test_a_block_without_a_source_is_named():
    with pytest.raises(ValueError, match="found 'nowhere'"):
        readme.fill("<!-- begin nowhere -->\nold\n<!-- end nowhere -->", {})


def test_the_steps_of_a_reproduction_are_added_up(tmp_path):
    row = {"command": "experiments.run", "code": "", "status": "finished"}
    steps = [("hdc", "full", 60, 5e8), ("cnn3", "full", 7200, 15e8), ("hdc", "quick", 30, 4e8)]
    for step, mode, seconds, memory in steps:
        cells = {"step": step, "mode": mode, "seconds": float(seconds), "peak_bytes": int(memory)}
        reproduce.write(tmp_path, row | cells)
    for step, seconds, status in (("fuzz", 9e9, "failed"), ("cnn1", 600.0, "interrupted")):
        cells = {"step": step, "mode": "full", "seconds": seconds, "peak_bytes": 1}
        reproduce.write(tmp_path, row | cells | {"status": status})
    table = readme.sources(tmp_path)["reproduction"]()
    assert "| `make reproduce` | 2, and part of cnn1 (10 min) | 2.0 h |" in table
    assert "| 1.50 GB (cnn3), 0.50 GB (hdc) |" in table
    assert "| `make reproduce QUICK=1` | 1 | 30 s | 0.40 GB (hdc) |" in table
