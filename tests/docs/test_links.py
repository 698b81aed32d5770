"""Links of README, CONTRIBUTING and docs between files lead to files and to heads in them."""

import re
from pathlib import Path

import pytest

from tests.docs.test_words import PAGES

LINK = re.compile(r'\]\(([^)\s]+)\)|src="([^"]+)"')


def anchors(page):
    """Anchors of the heads of a page, as GitHub and the site make them."""
    heads = re.findall(r"^#+ (.*)$", page.read_text("utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_to_a_file_and_its_head(page):
    found = ["".join(groups) for groups in LINK.findall(page.read_text("utf-8"))]
    for link in found:
        if re.match(r"\w+:", link):
            continue
        name, _, anchor = link.partition("#")
        target: Path = page.parent / name if name else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link
