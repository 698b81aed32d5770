"""The page in a real browser: no error, no request, nothing wider than a phone."""

import io

import pytest
from rich.console import Console

from experiments import report

# What a reader sees once every part is unfolded and every figure loaded.
SEEN = """async () => {
  document.querySelectorAll("details").forEach((d) => { d.open = true; });
  document.querySelectorAll(".all input").forEach((i) => { i.checked = true; });
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
    assert [url for url in requests if not url.startswith("data:")] == [address]
    assert problems == seen["broken"] == []
    assert seen["images"] > 3
    assert seen["needed"] <= width
