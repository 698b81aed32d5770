"""The page in a real browser: no error, no other host, nothing wider than a phone; heads sort."""

import io

import pytest
from rich.console import Console

from experiments import report


@pytest.mark.parametrize("width", [400, 1400])
@pytest.mark.usefixtures("beside_the_reference")
def test_it_works_on_a_phone_and_on_a_desk(browser, tmp_path, a_full_set, width):
    address = report.write(tmp_path, Console(file=io.StringIO())).as_uri()
    page = browser.new_page(viewport={"width": width, "height": 900})
    problems, requests = [], []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda message: problems.append(message.text))
    page.on("request", lambda request: requests.append(request.url))
    page.goto(address)
    page.click("nav a[href='#reference-claims']")  # a link opens what is folded
    page.wait_for_selector("details[open] > #reference-claims")
    page.evaluate(
        "document.querySelectorAll('details').forEach((d) => { d.open = true; })"
    )
    for image in page.locator("img").all():
        image.scroll_into_view_if_needed()
        image.evaluate("(image) => image.decode()")  # an error if its file is not there
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    cells = page.locator("#table1 tbody td:nth-child(2)")
    head = page.locator("#table1 th button").nth(1)
    head.click()
    up = cells.all_inner_texts()
    assert head.locator("..").get_attribute("aria-sort") == "ascending"
    head.press("Enter")  # by the keyboard as well
    assert cells.all_inner_texts() == up[::-1]
    numbers = [float(text) for text in up if text not in ("–", "not measured yet")]
    assert numbers == sorted(numbers)
    assert len(set(numbers)) > 2
    page.close()
    assert problems == []
    assert {url.partition(":")[0] for url in requests} == {"file"}
