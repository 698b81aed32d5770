"""The page in a real browser: no error, no other host, every figure there."""

import io

import pytest
from rich.console import Console

from experiments import report


@pytest.mark.usefixtures("beside_the_reference")
def test_the_page_opens_without_a_script_error(browser, tmp_path, runs_of_table1):
    address = report.write(tmp_path, Console(file=io.StringIO())).as_uri()
    page = browser.new_page()
    problems, requests = [], []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda message: problems.append(message.text))
    page.on("request", lambda request: requests.append(request.url))
    page.goto(address)
    page.click("nav a[href='#reference-claims']")  # a link opens what is folded
    page.wait_for_selector("details[open] > #reference-claims")
    page.locator("#table1 th button").nth(1).click()  # sorts
    for image in page.locator("img").all():
        image.evaluate("(image) => image.decode()")  # an error if its file is not there
    page.close()
    assert problems == []
    assert {url.partition(":")[0] for url in requests} == {"file"}
