"""The page in a real browser: no error, no request, nothing wider than a phone."""

import io

import pytest
from rich.console import Console

from experiments import report

# What a reader sees once every part is unfolded and every figure loaded.
SEEN = """async () => {
  document.querySelectorAll("details").forEach((d) => { d.open = true; });
  for (const image of document.images) { image.loading = "eager"; await image.decode(); }
  return {
    broken: [...document.images].filter((i) => !i.complete || !i.naturalWidth).map((i) => i.alt),
    images: document.images.length,
    needed: document.documentElement.scrollWidth,
    hints: [...document.querySelectorAll(".hint")].filter((h) => !h.hidden).length,
  };
}"""


@pytest.mark.parametrize("width", [400, 1400])
def test_it_works_on_a_phone_and_on_a_desk(browser, tmp_path, a_full_set, width):
    address = report.write(tmp_path, Console(file=io.StringIO())).as_uri()
    page = browser.new_page(viewport={"width": width, "height": 900})
    problems, requests = [], []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda message: problems.append(message.text))
    page.on("request", lambda request: requests.append(request.url))
    page.goto(address)
    page.click("nav a[href='#comparison']")  # a folded section opens for a link
    page.wait_for_selector("#comparison > details[open]")
    seen = page.evaluate(SEEN)
    page.close()
    outside = [url for url in requests if not url.startswith(("data:", "file:"))]
    assert outside == problems == seen["broken"] == []
    assert seen["images"] > 2
    assert seen["needed"] <= width
    assert seen["hints"] > 0 or width > 1000  # a wide table says that it scrolls


def test_a_click_on_a_head_sorts_by_value_and_again_the_other_way(
    browser, tmp_path, a_full_set
):
    address = report.write(tmp_path, Console(file=io.StringIO())).as_uri()
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    page.goto(address)
    page.evaluate(SEEN)
    table = page.locator(".item:has(tbody tr:nth-child(4))").first
    head = table.locator("th.number button").first
    head.click()
    at = int(head.evaluate("button => button.parentElement.cellIndex"))
    cells = table.locator(f"tbody td:nth-child({at + 1})")
    texts = cells.all_inner_texts()
    known = [text.split()[0].replace("−", "-") for text in texts if text != "–"]
    up = [float(text.replace(",", "")) for text in known]
    assert up == sorted(up)
    assert head.locator("..").get_attribute("aria-sort") == "ascending"
    head.press("Enter")  # by the keyboard as well
    assert head.locator("..").get_attribute("aria-sort") == "descending"
    page.close()
