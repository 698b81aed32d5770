"""The page in a real browser: no error, no request, the chart drawn, nothing wider than a phone."""

import html
import json
import re
import shutil
import subprocess

import pytest

from experiments import figures
from experiments.selection import Records

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
# The page stands in a frame: a window is never as narrow as a phone.
FRAME = """
<!doctype html><body>
<iframe src="probed.html" style="border: 0; height: 800px; width: {width}px"></iframe>
<script>
addEventListener("message", (e) => {{
  const out = document.createElement("pre");
  out.id = "probe";
  out.textContent = e.data;
  document.body.append(out);
}});
</script>
"""
# Runs in the page when its own scripts are done, and sends what it found to the frame around it.
PROBE = """
<script>
window.problems = [];
for (const kind of ["error", "unhandledrejection"])
  addEventListener(kind, (e) => problems.push(String(e.message || e.reason)), true);
const fail = console.error;
console.error = (...words) => { problems.push(words.join(" ")); fail(...words); };
console.warn = console.error;
addEventListener("load", async () => {
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  while (!document.querySelector("#chart svg .mark-symbol path")) await wait(50);
  const hovered = [];
  for (const mark of document.querySelectorAll("#chart svg .mark-symbol.role-mark path")) {
    const box = mark.getBoundingClientRect();
    const at = { clientX: box.x + box.width / 2, clientY: box.y + box.height / 2, bubbles: true };
    mark.dispatchEvent(new PointerEvent("pointermove", at));
    mark.dispatchEvent(new MouseEvent("mousemove", at));
    hovered.push(document.querySelector("#vg-tooltip-element.visible")?.innerText || "");
  }
  const found = {
    problems,
    hovered,
    requests: performance.getEntriesByType("resource").map((e) => e.name)
      .filter((name) => !name.startsWith("data:")),
    broken: [...document.images].filter((i) => !i.complete || !i.naturalWidth).map((i) => i.alt),
    images: document.images.length,
    width: innerWidth,
    needed: document.documentElement.scrollWidth,
    background: getComputedStyle(document.body).backgroundColor,
    cells: [...document.querySelectorAll("#comparison tbody tr")].map(
      (row) => [...row.cells].map((cell) => cell.dataset.exact || cell.innerText.trim())),
  };
  parent.postMessage(JSON.stringify(found), "*");
});
</script>
"""


@pytest.fixture
def opened(tmp_path, a_full_set, write_page):
    """opened(width, flags) → what the probe finds on a page, and the rows it is made from."""
    if CHROMIUM is None:
        pytest.skip("no browser here: looked for chromium, chromium-browser and google-chrome")
    (tmp_path / "figures").mkdir()
    figure = figures.error_vs_time(Records(tmp_path))
    (tmp_path / "figures" / "error_vs_time.svg").write_bytes(figures.save(figure, "svg"))
    figures.plt.close(figure)
    made, compared, _ = write_page()
    (tmp_path / "probed.html").write_text(made.read_text().replace("<head>", "<head>" + PROBE, 1))

    def run(width, *flags):
        (tmp_path / "frame.html").write_text(FRAME.format(width=width))
        done = subprocess.run(
            [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr",
             f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=20000", "--dump-dom",
             "--window-size=1400,900", *flags, (tmp_path / "frame.html").as_uri()],
            capture_output=True, text=True, check=True, timeout=120,
        )  # fmt: skip
        assert not re.findall(r"CONSOLE.*", done.stderr)
        (found,) = re.findall(r'<pre id="probe">(.*?)</pre>', done.stdout, re.DOTALL)
        return json.loads(html.unescape(found)), compared

    return run


@pytest.mark.parametrize("width", [400, 1280])
def test_it_works_on_a_phone_and_on_a_desk(opened, width):
    found, compared = opened(width)
    assert found["problems"] == []
    assert found["requests"] == []
    assert found["broken"] == []
    assert found["images"] > 1
    assert found["needed"] <= found["width"] == width
    assert [cells[1] for cells in found["cells"]] == [row["verdict"] for row in compared]
    assert len(found["hovered"]) > 10
    assert all("training time (s)" in text for text in found["hovered"])
    assert sum("published, Table I" in text for text in found["hovered"]) == 4
