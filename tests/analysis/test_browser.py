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
#: Appended to a copy of the page: measures, and leaves what it found in the title.
PROBE = """<script>addEventListener("load", () => {
  const scrolls = node => [...node.querySelectorAll(".scroll")].filter(e => e.scrollWidth > e.clientWidth + 1).length;
  const wide = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  const height = document.documentElement.scrollHeight;
  const answer = document.querySelector("#answer");
  const sideways = answer ? scrolls(answer) + [...answer.querySelectorAll("*")].filter(e => {
    const box = e.getBoundingClientRect();
    return box.width > 0 && box.right > innerWidth + 1;
  }).length : -1;
  for (const part of document.querySelectorAll("details")) part.open = true;
  const hidden = scrolls(document);
  const images = [...document.images];
  const broken = images.filter(i => !i.complete || i.naturalWidth === 0).length;
  const clipped = [...document.querySelectorAll("figure img, table")].filter(e => {
    const box = e.getBoundingClientRect(), scroller = e.closest(".scroll");
    return box.right > innerWidth + 1 && !(scroller && scroller.scrollWidth >= e.offsetWidth);
  }).length;
  const requests = performance.getEntriesByType("resource").filter(r => !r.name.startsWith("data:")).length;
  const names = [...document.querySelectorAll(".scroll th:first-child")].filter(e => e.offsetWidth > 0);
  const narrow = names.filter(e => e.offsetWidth < 90).length;
  const found = {narrow, wide, height, sideways, hidden, images: images.length, broken, clipped, requests};
  TELL(`PROBE ${Object.entries(found).map(pair => pair.join("=")).join(" ")}`);
});</script></body>"""
IN_PAGE = PROBE.replace("TELL(", "document.title = (")
IN_FRAME = PROBE.replace("TELL(", "(words => parent.postMessage(words, '*'))(")
#: A reader's clicks, and what they change.
CLICKS = """<script>addEventListener("load", () => {
  const found = {}, count = selector => document.querySelectorAll(selector).length;
  const figure = document.querySelector("figure[data-curves]"), svg = figure.querySelector(".panel svg");
  found.picture = getComputedStyle(figure.querySelector(".static")).display;
  found.lines = count('.panel path.mean[data-arm="aan"]');
  figure.querySelector('button[data-arm="aan"]').click();
  found.off = count('.panel path.mean[data-arm="aan"]');
  found.others = count('.panel path.mean[data-arm="bptsan"]');
  figure.querySelector('button[data-arm="aan"]').click();
  found.again = count('.panel path.mean[data-arm="aan"]');
  figure.querySelector("input[type=checkbox]").click();
  found.seeds = count('.panel path.seed[data-arm="aan"]');
  const box = svg.getBoundingClientRect();
  svg.dispatchEvent(new PointerEvent("pointermove", {clientX: box.right - 5, clientY: box.top + 50, bubbles: true}));
  found.told = figure.querySelector(".panel output").textContent.replaceAll(" ", "_");
  for (const part of document.querySelectorAll("details")) part.open = true;
  const table = document.querySelector('#table-seeds table'), column = 2;
  const numbers = () => [...table.tBodies[0].rows].map(r => +r.cells[column].textContent.replace(/,/g, ""));
  const sorted = values => values.every((v, i) => i === 0 || values[i - 1] <= v);
  found.before = sorted(numbers());
  table.tHead.querySelectorAll("button")[column].click();
  found.after = sorted(numbers());
  const filter = document.querySelector("#table-seeds input[type=search]");
  filter.value = "bpt-san w/o hopper";
  filter.dispatchEvent(new Event("input"));
  found.filtered = [...table.tBodies[0].rows].filter(r => !r.hidden).every(r => /w\\/o/.test(r.textContent));
  for (const part of document.querySelectorAll("details")) part.open = false;
  dispatchEvent(new Event("beforeprint"));
  found.closed = count("details:not([open])");
  document.title = `CLICKS ${Object.entries(found).map(pair => pair.join("=")).join(" ")}`;
});</script></body>"""


def browse(page, tmp_path, width, *arguments):
    command = [
        CHROMIUM,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--disable-sync",
        "--no-first-run",
        f"--user-data-dir={tmp_path / 'profile'}",
        f"--window-size={width},2000",
        "--enable-logging=stderr",
        "--v=0",
        *arguments,
        page.as_uri(),
    ]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)


def with_script(study, script):
    """The page with a test's own script, which the page's policy would not let run."""
    html = (study / "report/index.html").read_text()
    changed = re.sub(r"script-src '[^']*'", "script-src 'unsafe-inline'", html)
    assert changed != html
    return changed.replace("</body>", script)


def told(word, text):
    found = re.search(f"{word} ([^<]*)", text)
    assert found, "the probe did not run"
    return dict(part.split("=", 1) for part in found.group(1).split())


@pytest.mark.parametrize("width", [1440, 800, 500])  # Chromium opens no window narrower than 500 pixels
def test_nothing_is_clipped_broken_or_requested(mixed_report, tmp_path, width):
    probed = tmp_path / "probed.html"
    probed.write_text(with_script(mixed_report, IN_PAGE))
    values = told("PROBE", browse(probed, tmp_path, width, "--dump-dom").stdout)
    assert int(values["images"]) >= 10 and int(values["wide"]) <= 0
    assert (values["broken"], values["clipped"], values["requests"], values["sideways"]) == ("0", "0", "0", "0")
    if width == 1440:
        assert values["hidden"] == "0", "a table is wider than the page"
        assert int(values["height"]) < 6000


def test_a_phone_sees_no_sideways_scrolling(mixed_report, tmp_path):
    """A frame of 390 pixels, as wide as a phone: the page does not scroll sideways, nor does any part of the answer."""
    (tmp_path / "page.html").write_text(with_script(mixed_report, IN_FRAME))
    frame = tmp_path / "frame.html"
    frame.write_text(
        "<title>none</title><script>addEventListener('message', e => document.title = e.data)</script>"
        "<iframe src='page.html' width=390 height=3000 style='border:0'></iframe>"
    )
    values = told("PROBE", browse(frame, tmp_path, 800, "--dump-dom", "--virtual-time-budget=5000").stdout)
    assert (values["wide"], values["sideways"], values["clipped"], values["broken"]) == ("0", "0", "0", "0")
    assert values["narrow"] == "0", "names stand in a column of a few letters"


def test_clicks_do_what_they_say(mixed_report, tmp_path):
    clicked = tmp_path / "clicked.html"
    clicked.write_text(with_script(mixed_report, CLICKS))
    found = told("CLICKS", browse(clicked, tmp_path, 1280, "--dump-dom").stdout)
    panels = int(found["lines"])
    assert panels == 2 and found["off"] == "0" and found["others"] == "2" and found["again"] == "2"
    assert int(found["seeds"]) == 3 * panels and found["picture"] == "none"
    assert found["told"].startswith("Step_100,000:") and "AAN_" in found["told"]
    assert (found["before"], found["after"], found["filtered"], found["closed"]) == ("false", "true", "true", "0")


def test_the_pages_own_script_runs_under_its_policy_and_logs_no_error(mixed_report, tmp_path):
    result = browse(mixed_report / "report/index.html", tmp_path, 1280, "--dump-dom")
    assert '<html lang="en" class="js">' in result.stdout and 'class="panel"' in result.stdout
    assert [line for line in result.stderr.splitlines() if "CONSOLE" in line] == []


def test_no_other_script_runs(mixed_report, tmp_path):
    html = (mixed_report / "report/index.html").read_text()
    (tmp_path / "changed.html").write_text(html.replace('"use strict";', '"use strict"; document.title = "changed";'))
    result = browse(tmp_path / "changed.html", tmp_path, 1280, "--dump-dom")
    assert "<title>changed" not in result.stdout and 'class="js"' not in result.stdout
    assert "CONSOLE" in result.stderr


def test_the_probe_can_fail(tmp_path):
    page = tmp_path / "bad.html"
    page.write_text(
        "<title>x</title><body><img src='http://127.0.0.1:9/nothing.png'><div style='width:9000px'>x</div>"
        "<script>console.error('x')</script>" + IN_PAGE
    )
    result = browse(page, tmp_path, 1280, "--dump-dom")
    assert "broken=1" in result.stdout and "wide=0" not in result.stdout and "requests=0" not in result.stdout
    assert "CONSOLE" in result.stderr
