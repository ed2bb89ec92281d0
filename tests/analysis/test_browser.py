"""If these fail, a reader's browser shows the report with an error, a request, or something cut off."""

import re
import shutil
import subprocess

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed (apt-get install chromium)"),
]
#: Appended to a copy of the page: measures, and leaves what it found in the title. The page itself runs no script.
PROBE = """<script>addEventListener("load", () => {
  const wide = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  const images = [...document.images];
  const broken = images.filter(i => !i.complete || i.naturalWidth === 0).length;
  const clipped = [...document.querySelectorAll("figure img, table")].filter(e => {
    const box = e.getBoundingClientRect(), scroller = e.closest(".scroll");
    return box.right > innerWidth + 1 && !(scroller && scroller.scrollWidth >= e.offsetWidth);
  }).length;
  const requests = performance.getEntriesByType("resource").filter(r => !r.name.startsWith("data:")).length;
  const found = `wide=${wide} images=${images.length} broken=${broken} clipped=${clipped} requests=${requests}`;
  document.title = `PROBE ${found}`;
});</script></body>"""

IN_FRAME = PROBE.replace("document.title = `PROBE ${found}`;", "parent.postMessage(`PROBE ${found}`, '*');")


def browse(page, tmp_path, width, *arguments):
    command = [
        CHROMIUM,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--no-first-run",
        f"--user-data-dir={tmp_path / 'profile'}",
        f"--window-size={width},2000",
        "--enable-logging=stderr",
        "--v=0",
        *arguments,
        page.as_uri(),
    ]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)


@pytest.mark.parametrize("width", [1280, 500])  # Chromium opens no window narrower than 500 pixels
def test_nothing_is_clipped_broken_or_requested(mixed_report, tmp_path, width):
    html = (mixed_report / "report/index.html").read_text()
    html = html.replace("style-src 'unsafe-inline'", "style-src 'unsafe-inline'; script-src 'unsafe-inline'").replace(
        "</body>", PROBE
    )
    probed = tmp_path / "probed.html"
    probed.write_text(html)
    found = re.search(r"PROBE [^<]*", browse(probed, tmp_path, width, "--dump-dom").stdout)
    assert found, "the probe did not run"
    values = dict(part.split("=") for part in found.group().split()[1:])
    assert int(values.pop("images")) >= 10
    assert int(values.pop("wide")) <= 0
    assert values == {"broken": "0", "clipped": "0", "requests": "0"}


def test_a_phone_sees_no_sideways_scrolling(mixed_report, tmp_path):
    """A frame of 390 pixels, as wide as a phone."""
    html = (mixed_report / "report/index.html").read_text()
    html = html.replace("style-src 'unsafe-inline'", "style-src 'unsafe-inline'; script-src 'unsafe-inline'")
    (tmp_path / "page.html").write_text(html.replace("</body>", IN_FRAME))
    frame = tmp_path / "frame.html"
    frame.write_text(
        "<title>none</title><script>addEventListener('message', e => document.title = e.data)</script>"
        "<iframe src='page.html' width=390 height=3000 style='border:0'></iframe>"
    )
    found = re.search(r"PROBE [^<]*", browse(frame, tmp_path, 800, "--dump-dom", "--virtual-time-budget=5000").stdout)
    assert found and "wide=0 " in found.group() and "clipped=0" in found.group() and "broken=0" in found.group()


def test_no_console_error(mixed_report, tmp_path):
    result = browse(mixed_report / "report/index.html", tmp_path, 1280, f"--screenshot={tmp_path / 'page.png'}")
    assert [line for line in result.stderr.splitlines() if "CONSOLE" in line] == []
    assert (tmp_path / "page.png").stat().st_size > 10_000


def test_the_probe_can_fail(tmp_path):
    page = tmp_path / "bad.html"
    page.write_text(
        "<title>x</title><body><img src='http://127.0.0.1:9/nothing.png'><div style='width:9000px'>x</div>"
        "<script>console.error('x')</script>" + PROBE
    )
    result = browse(page, tmp_path, 1280, "--dump-dom")
    assert "broken=1" in result.stdout and "wide=0" not in result.stdout and "requests=0" not in result.stdout
    assert "CONSOLE" in result.stderr
