"""The page in a real browser: no error, no request, nothing wider than a phone."""

import io

import pytest
from rich.console import Console

from experiments import report

# What a reader sees once every part is unfolded and every figure loaded.
SEEN = """async () => {
  document.querySelectorAll("details").forEach((d) => { d.open = true; });
  document.querySelectorAll(".all input").forEach((i) => { i.checked = true; });
  while (![...document.images].every((i) => i.src)) await new Promise((r) => setTimeout(r, 20));
  for (const image of document.images) await image.decode();
  return {
    broken: [...document.images].filter((i) => !i.complete || !i.naturalWidth).map((i) => i.alt),
    images: document.images.length,
    needed: document.documentElement.scrollWidth,
  };
}"""


@pytest.mark.parametrize("width", [400, 1280])
def test_it_works_on_a_phone_and_on_a_desk(browser, tmp_path, a_full_set, width):
    address = report.write(tmp_path, Console(file=io.StringIO())).as_uri()
    page = browser.new_page(viewport={"width": width, "height": 900})
    problems, requests = [], []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda message: problems.append(message.text))
    page.on("request", lambda request: requests.append(request.url))
    page.goto(address)
    page.evaluate("document.querySelector('nav details').open = true")
    page.click("nav a[href='#comparison']")  # a folded section opens for a link
    page.wait_for_selector("#comparison > details[open]")
    assert abs(page.locator("#comparison").bounding_box()["y"]) < 2
    figure = page.locator("details[open] figure").first
    before = figure.bounding_box()["width"]
    figure.locator("a").click()
    assert figure.bounding_box()["width"] == width
    page.keyboard.press("Escape")
    assert figure.bounding_box()["width"] == before
    seen = page.evaluate(SEEN)
    page.close()
    asked = [url for url in requests if not url.startswith(("data:", "blob:"))]
    assert asked == [address]
    assert problems == seen["broken"] == []
    assert seen["images"] > 3
    assert seen["needed"] <= width


@pytest.fixture
def opened(browser, tmp_path, a_full_set):
    """The page with every part unfolded, and what its console said."""
    address = report.write(tmp_path, Console(file=io.StringIO())).as_uri()
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    said = []
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("console", lambda message: said.append(message.text))
    page.goto(address)
    page.evaluate(SEEN)
    yield page
    page.close()
    assert said == []


TABLE = "#reference-table-accuracy_vs_n"


def column(page, name):
    """Texts of a column of the table, of the rows that are shown, from top to bottom."""
    heads = page.locator(f"{TABLE} th").all_inner_texts()
    at = [text.strip(" ▲▼") for text in heads].index(name) + 1
    cells = page.locator(f"{TABLE} tbody tr:not([hidden]) td:nth-child({at})")
    return cells.all_inner_texts()


def test_a_click_on_a_head_sorts_by_value_and_again_the_other_way(opened):
    head = opened.locator(f"{TABLE} th button", has_text="N").first
    head.click()
    up = [int(text) for text in column(opened, "N")]
    assert up == sorted(up)
    assert len(set(up)) > 2
    assert head.locator("..").get_attribute("aria-sort") == "ascending"
    head.press("Enter")  # by the keyboard as well
    assert [int(text) for text in column(opened, "N")] == up[::-1]


def test_rows_are_filtered_by_model_and_by_words(opened):
    before = column(opened, "Model")
    opened.select_option(".filters [name=model]", "hdc")
    assert set(column(opened, "Model")) == {"HDC"} < set(before)
    opened.select_option(".filters [name=model]", "")
    opened.fill(f"{TABLE} .find", "ridge")
    found = column(opened, "Model")
    assert found
    assert all("ridge" in text.lower() for text in found)
    opened.fill(f"{TABLE} .find", "")
    assert column(opened, "Model") == before


def test_only_what_lies_outside_the_reference_is_shown_where_it_is_asked_for(opened):
    shown = "tbody tr:not([hidden])"
    outside = opened.locator("tr[data-outside]").count()
    assert 0 < outside < opened.locator(shown).count()
    opened.check(".filters [name=differences]")
    assert opened.locator(shown).count() == outside
    assert opened.locator("td.outside").count() > 0
