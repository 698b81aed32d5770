"""The page in a real browser: no error, no request, nothing wider than a phone."""

import io

from rich.console import Console

from experiments import report

WIDTHS = (400, 1280)
# What a reader sees once every part is unfolded and every figure loaded.
FOUND = """async () => {
  document.querySelectorAll("details").forEach((d) => { d.open = true; });
  document.querySelectorAll(".all input").forEach((i) => { i.checked = true; });
  for (const image of document.images) await image.decode();
  return {
    broken: [...document.images].filter((i) => !i.complete || !i.naturalWidth).map((i) => i.alt),
    images: document.images.length,
    needed: document.documentElement.scrollWidth,
    cells: [...document.querySelectorAll("#table-comparison tbody tr")].map(
      (row) => [...row.cells].map((cell) => cell.innerText.trim())),
    hidden: [...document.querySelectorAll("td, figcaption, p")].filter(
      (e) => e.innerText.trim() && !e.getBoundingClientRect().height).map((e) => e.innerText),
  };
}"""


def test_it_works_on_a_phone_and_on_a_desk(browser, tmp_path, a_full_set):
    """With own results beside the reference."""
    made = report.write(tmp_path, "cpu", Console(file=io.StringIO())).as_uri()
    for width in WIDTHS:
        page = browser.new_page(viewport={"width": width, "height": 900})
        problems, requests = [], []
        page.on("pageerror", lambda error, to=problems: to.append(str(error)))
        page.on("console", lambda said, to=problems: to.append(said.text))
        page.on("request", lambda asked, to=requests: to.append(asked.url))
        page.goto(made)
        found = page.evaluate(FOUND)
        page.close()
        assert [url for url in requests if not url.startswith("data:")] == [made]
        assert problems == found["broken"] == found["hidden"] == []
        assert found["images"] > 10
        assert found["needed"] <= width
        assert len(found["cells"]) > 20
        assert all(all(cells) for cells in found["cells"])


def test_what_is_folded_opens_for_a_link_and_figures_grow(browser, tmp_path, a_full_set):
    made = report.write(tmp_path, "cpu", Console(file=io.StringIO())).as_uri()
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    page.goto(made)
    comparison, table1 = (page.locator(f"#{name} > details") for name in ("comparison", "table1"))
    assert table1.get_attribute("open") is not None
    assert comparison.get_attribute("open") is None
    page.click("nav a[href='#comparison']")
    page.wait_for_selector("#comparison > details[open]")
    assert abs(page.locator("#comparison").bounding_box()["y"]) < 2
    page.goto(f"{made}#reference-figure-fig4_correlations")
    page.reload()
    page.wait_for_selector("#correlation > details[open]")
    figure = page.locator("#reference-figure-fig4_correlations")
    before = figure.bounding_box()["width"]
    figure.locator("a").click()
    assert figure.bounding_box()["width"] > 1.5 * before
    assert figure.bounding_box()["height"] <= 900
    page.keyboard.press("Escape")
    assert figure.bounding_box()["width"] == before
    page.close()
