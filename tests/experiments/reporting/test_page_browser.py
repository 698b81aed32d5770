"""The page in a real browser: no error, no request, nothing wider than a phone."""

import html
import io
import json
import re
import shutil
import subprocess

import pytest
from rich.console import Console

from experiments import report

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
WIDTHS = (400, 1280)
# The page stands in frames: a window is never as narrow as a phone.
FRAMES = """
<!doctype html><body>
<script>
for (const width of {widths}) {{
  const frame = document.createElement("iframe");
  frame.src = "probed.html";
  frame.style = `border: 0; height: 800px; width: ${{width}}px`;
  document.body.append(frame);
}}
addEventListener("message", (e) => {{
  const out = document.createElement("pre");
  out.className = "probe";
  out.textContent = e.data;
  document.body.append(out);
}});
</script>
"""
# Runs in the page when it is there, and sends what it found to the frame around it.
PROBE = """
<script>
window.problems = [];
for (const kind of ["error", "unhandledrejection"])
  addEventListener(kind, (e) => problems.push(String(e.message || e.reason || e.target)), true);
addEventListener("load", async () => {
  document.querySelectorAll("details").forEach((d) => { d.open = true; });
  for (const image of document.images) { image.loading = "eager"; await image.decode(); }
  const found = {
    problems,
    requests: performance.getEntriesByType("resource").map((e) => e.name)
      .filter((name) => !name.startsWith("data:")),
    broken: [...document.images].filter((i) => !i.complete || !i.naturalWidth).map((i) => i.alt),
    images: document.images.length,
    width: innerWidth,
    needed: document.documentElement.scrollWidth,
    cells: [...document.querySelectorAll("#comparison tbody tr")].map(
      (row) => [...row.cells].map((cell) => cell.innerText.trim())),
    hidden: [...document.querySelectorAll("td, figcaption, p")].filter(
      (e) => e.innerText.trim() && !e.getBoundingClientRect().height).map((e) => e.innerText),
  };
  parent.postMessage(JSON.stringify(found), "*");
});
</script>
"""


@pytest.fixture
def opened(tmp_path, a_full_set):
    """What the probe finds on the page at each width, with own results beside the reference."""
    if CHROMIUM is None:
        pytest.skip("no browser here: looked for chromium, chromium-browser and google-chrome")
    made = report.write(tmp_path, "cpu", Console(file=io.StringIO()))
    page = made.read_text(encoding="utf-8").replace("<head>", "<head>" + PROBE, 1)
    (tmp_path / "probed.html").write_text(page, encoding="utf-8")
    (tmp_path / "frames.html").write_text(FRAMES.format(widths=list(WIDTHS)))
    done = subprocess.run(
        [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr",
         f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=20000", "--dump-dom",
         "--window-size=1400,900", (tmp_path / "frames.html").as_uri()],
        capture_output=True, text=True, check=True, timeout=120,
    )  # fmt: skip
    assert not re.findall(r"CONSOLE.*", done.stderr)
    found = re.findall(r'<pre class="probe">(.*?)</pre>', done.stdout, re.DOTALL)
    return [json.loads(html.unescape(text)) for text in found]


def test_it_works_on_a_phone_and_on_a_desk(opened):
    assert sorted(found["width"] for found in opened) == sorted(WIDTHS)
    for found in opened:
        assert found["problems"] == found["requests"] == found["broken"] == found["hidden"] == []
        assert found["images"] > 10
        assert found["needed"] <= found["width"]
        assert len(found["cells"]) > 20
        assert all(all(cells) for cells in found["cells"])
