"""The site builds without a warning, and its pages ask nothing of any other host."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("sphinx")
CHECKOUT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    options = ["-q", "-W", "--keep-going", "-b", "html", "-d", folder / "doctrees"]
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, CHECKOUT / "docs", folder / "html"],
        cwd=CHECKOUT, env={"PYTHONPATH": str(CHECKOUT)}, capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return folder / "html"


LOADED = re.compile(
    r'<(?:script|img|iframe|source)\b[^>]*\bsrc="([^"]+)|<link\b[^>]*\bhref="([^"]+)'
)
"""What a page loads by itself."""


def test_pages_load_only_what_lies_beside_them(site):
    for page in site.glob("*.html"):
        found = ["".join(groups) for groups in LOADED.findall(page.read_text())]
        assert found
        for name in found:
            assert not re.match(r"\w+:|//", name), (page.name, name)
            file = re.split("[?#]", name)[0] or page.name
            assert (site / file).is_file(), (page.name, name)
    elsewhere = re.compile(r"url\(\s*['\"]?(\w+:)?//|@import\s+\S*//")
    assert not [css for css in site.rglob("*.css") if elsewhere.search(css.read_text())]
