"""Every number in README and docs is drawn from a record, or has its source here."""

import re
from pathlib import Path

import pytest
import yaml

from experiments import reference
from experiments.protocol import data
from experiments.records import timing
from hdc.prediction import CHUNK
from scenes.sensor.camera import Camera

CHECKOUT = Path(__file__).resolve().parents[2]
PAGES = [CHECKOUT / "README.md", *sorted((CHECKOUT / "docs").glob("*.md"))]
# What is no prose: blocks made from records, code (which test_commands.py runs), formulas, links,
# numbers of items, and figures and tables of the paper.
NO_PROSE = (
    r"<!-- begin (\w+) -->.*?<!-- end \1 -->",
    r"^```.*?^```",
    r"\$\$.*?\$\$|\$[^$\n]*\$",
    r"`[^`]*`",
    r"^    .*?$",
    r"\]\([^)]*\)",
    r"^\s*\d+\. ",
    r"Figs?\. [\d(][^|]*|Table I",
)
AGAIN = "python -m experiments.reference --tables"
NUMBER = r"(?<![\w.,])\d[\d.,]*\d|(?<![\w.,])\d"


def config(name):
    return yaml.safe_load((CHECKOUT / "configs" / f"{name}.yaml").read_text())


def pixels():
    return Camera.crop**2


def article():
    cited = yaml.safe_load((CHECKOUT / "CITATION.cff").read_text())["references"][0]
    arxiv = cited["identifiers"][0]["value"].removeprefix("arXiv:")
    return [cited["volume"], cited["start"], cited["year"], arxiv]


# What stands before and after a number → what it is.
SOURCES = {
    r"Optics Express (N), (N) \((N)\), arXiv (N)": article,
    r"Optics Express (N), (N) \((N)\)\)": lambda: article()[:3],
    r"call the result a (N)-bit hypervector": lambda: [f"{pixels():,}"],
    r"or stop at (N) %": lambda: [100 * config("stop/paper")["target"]],
    r"more than (N) times the others": lambda: [timing.FACTOR],
    r"exit status (N)\.": lambda: [1],  # tests/experiments/test_sweeps.py
    r"Linux (N)": lambda: ["2.6.12"],  # flock(2)
    r"no class has more than (N) samples": lambda: [2**8 - 1],  # one byte
    r"\((N) MB for (N) classes of (N) pixels\)": lambda: [5 * pixels() / 1e6, 5, f"{pixels():,}"],
    r"its chunk of (N) packed frames": lambda: [CHUNK],
    r"training frames up to (N) MB": lambda: [data.IN_MEMORY_BYTES / 2**20],
    r"Rank (N) writes": lambda: [0],
    r"Speckle Phenomena in Optics\*, (N)\)": lambda: [2007],
}


def prose(page):
    text = page.read_text(encoding="utf-8")
    for pattern in NO_PROSE:
        text = re.sub(pattern, " ", text, flags=re.DOTALL | re.MULTILINE)
    return " ".join(text.split())


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_number_in_prose_is_what_its_source_says(page):
    text = prose(page)
    for pattern, source in SOURCES.items():
        for match in re.finditer(pattern.replace("(N)", f"({NUMBER})"), text):
            expected = [x if isinstance(x, str) else f"{x:g}" for x in source()]
            assert list(match.groups()) == expected, match[0]
        text = re.sub(pattern.replace("(N)", f"({NUMBER})"), " ", text)
    left = [text[max(0, m.start() - 40) : m.end() + 20] for m in re.finditer(NUMBER, text)]
    assert left == [], "numbers without a source in SOURCES"


def test_the_blocks_of_the_readme_are_those_of_the_reference():
    text = (CHECKOUT / "README.md").read_text(encoding="utf-8")
    assert text == reference.fill(text, reference.blocks()), AGAIN
