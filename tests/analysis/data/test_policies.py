"""If these fail, the page shows another policy than it says, grows without bound, or a bad picture ends the report."""

import json
import struct
import zlib

import numpy as np
import pytest
from PIL import Image

from analysis.__main__ import main
from analysis.data import policies
from analysis.data.pictures import WIDTH
from benchmarks.synthetic import write_run

SUMMARY = """{label} on Hopper-v4: return -1,234 in 987 steps
episode of seed 7, policy of step 100,000, mean return of its evaluation 12.5

population ...
"""


def picture(path, width=40, height=30, noise=False):
    pixels = np.zeros((height, width, 4), dtype=np.uint8)
    pixels[: height // 2] = (255, 0, 0, 255)  # the rest is transparent
    if noise:
        pixels[:] = np.random.default_rng(0).integers(0, 256, pixels.shape)
    Image.fromarray(pixels).save(path)


def watched(study, seed=0, label="bptsan", kinds=("frames", "raster"), **options):
    """A run with pictures beside it, as src.watch leaves them."""
    folder = write_run(study, seed=seed, label=label, **options) / "watch"
    folder.mkdir()
    for kind in kinds:
        picture(folder / f"{kind}.png")
    (folder / "summary.txt").write_text(SUMMARY.format(label=label))
    return folder


def collected(study):
    assert main(["collect", str(study)]) == 0
    return json.loads((study / "collected/policies.json").read_text())


def notes(study):
    return json.loads((study / "collected/study.json").read_text())["warnings"]


def test_one_policy_per_arm_and_task_the_lowest_seed_with_its_episode(tmp_path):
    write_run(tmp_path / "s", seed=0)
    for seed in (1, 2):
        watched(tmp_path / "s", seed)
    watched(tmp_path / "s", 0, actor="aan", label="aan", kinds=("raster",))
    aan, bptsan = collected(tmp_path / "s")["shown"]
    assert (aan["arm"], bptsan["arm"], bptsan["seed"], bptsan["seeds"]) == ("aan", "bptsan", 1, [1, 2])
    assert [one["kind"] for one in aan["pictures"]] == ["raster"]
    assert [one["kind"] for one in bptsan["pictures"]] == ["frames", "raster"]
    assert (bptsan["return"], bptsan["steps"]) == ("-1,234", "987") and "policy of step 100,000" in bptsan["policy"]


def test_pictures_are_made_small_on_white_and_come_out_the_same_twice(tmp_path):
    folder = watched(tmp_path / "s")
    picture(folder / "raster.png", 3000, 900, noise=True)
    frames, raster = collected(tmp_path / "s")["shown"][0]["pictures"]
    first = (tmp_path / "s/collected" / raster["file"]).read_bytes()
    with Image.open(tmp_path / "s/collected" / raster["file"]) as image:
        assert image.size == (raster["width"], raster["height"]) == (WIDTH, 360) and image.mode == "P"
    with Image.open(tmp_path / "s/collected" / frames["file"]) as image:
        colours = image.convert("RGB")
        assert colours.getpixel((0, 0)) == (255, 0, 0) and colours.getpixel((0, 29)) == (255, 255, 255)
    collected(tmp_path / "s")
    assert (tmp_path / "s/collected" / raster["file"]).read_bytes() == first


def chunk(kind, content):
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def png(width, height, *chunks):
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + b"".join(chunks) + chunk(b"IEND", b"")


BAD = {
    "no picture": (b"no PNG", "cannot be read as a PNG (UnidentifiedImageError)"),
    "empty": (b"", "cannot be read as a PNG"),
    "another format": (b"GIF89a\x01\x00\x01\x00\x00\x00\x00;", "cannot be read as a PNG"),
    "only a header": (png(20, 20), "cannot be read as a PNG"),
    "torn": (png(20, 20, chunk(b"IDAT", zlib.compress(b"\0" * 30)[:-5])), "cannot be read as a PNG"),
    "no compressed data": (png(20, 20, chunk(b"IDAT", b"x" * 50)), "cannot be read as a PNG"),
    "a bomb": (png(60_000, 60_000, chunk(b"IDAT", zlib.compress(b"\0" * 9))), "more than 40 million pixels"),
    "large": (png(9_000, 9_000, chunk(b"IDAT", zlib.compress(b"\0" * 9))), "more than 40 million pixels"),
    "a flood of text": (png(20, 20, chunk(b"zTXt", b"a\0\0" + zlib.compress(b"x" * 2**23))), "cannot be read as a PNG"),
    "megabytes": (b"\0" * (2**24 + 1), "has more than 16 MB"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_picture_is_a_note_and_the_other_is_shown(tmp_path, name):
    content, sentence = BAD[name]
    folder = watched(tmp_path / "s")
    (folder / "raster.png").write_bytes(content)
    (policy,) = collected(tmp_path / "s")["shown"]
    assert [one["kind"] for one in policy["pictures"]] == ["frames"]
    (note,) = [note for note in notes(tmp_path / "s") if "raster.png" in note]
    assert sentence in note and note.startswith("runs/td3/hopper/bptsan/poisson/seed_0/watch: its raster.png")


def test_what_is_no_file_is_a_note_and_a_seed_without_pictures_gives_way_to_the_next(tmp_path):
    folder = watched(tmp_path / "s", 0, kinds=())
    (folder / "raster.png").mkdir()
    folder = watched(tmp_path / "s", 1, kinds=("raster",))
    (folder / "summary.txt").write_bytes(b"\xff\xfe")
    (policy,) = collected(tmp_path / "s")["shown"]
    assert policy["seed"] == 1 and policy["return"] is None
    assert len([note for note in notes(tmp_path / "s") if "watch: its " in note]) == 2


def test_a_summary_of_another_form_tells_no_return(tmp_path):
    folder = watched(tmp_path / "s")
    (folder / "summary.txt").write_text("something\nelse " + "x" * 1000)
    (policy,) = collected(tmp_path / "s")["shown"]
    assert policy["return"] is None and policy["policy"].startswith("else ") and len(policy["policy"]) == 160


def test_more_pictures_than_there_is_room_for_are_named(tmp_path, monkeypatch):
    for actor in ("popsan", "bptsan_wo_ndt", "bptsan"):
        folder = watched(tmp_path / "s", actor=actor, label=actor)
        picture(folder / "raster.png", 850, 850, noise=True)  # 0.7 MB each
    monkeypatch.setattr(policies, "MEGABYTES", 1)
    found = collected(tmp_path / "s")
    assert [one["arm"] for one in found["shown"]] == ["popsan"]
    assert [one["arm"] for one in found["left_out"]] == ["bptsan_wo_ndt", "bptsan"]
    for stage in ("figures", "statistics", "render"):
        assert main([stage, str(tmp_path / "s")]) == 0
    for page in ("index.html", "report.md"):
        words = (tmp_path / "s/report" / page).read_text()
        assert "stay under 1 MB: TD3, Hopper-v4, BPT-SAN w/o NDT; TD3, Hopper-v4, BPT-SAN." in words


def test_the_page_shows_them_by_itself_and_its_twin_by_links(tmp_path):
    folder = watched(tmp_path / "s", label="<b>mine")
    (folder / "episode.mp4").write_bytes(b"film")
    assert main(["report", str(tmp_path / "s")]) == 0
    html = (tmp_path / "s/report/index.html").read_text()
    section = html[html.index('id="policies"') : html.index('id="statistics"')]
    assert section.count('src="data:image/png;base64,') == 2 and 'href="#policies"' in html
    assert "&lt;b&gt;mine, seed 0: return -1,234 in 987 steps; episode of seed 7, policy of step 100,000" in section
    assert "<b>mine" not in html and "watch/episode.mp4" in section and "raster.pdf" not in section
    markdown = (tmp_path / "s/report/report.md").read_text()
    assert "](../collected/policies/000-raster.png)" in markdown and "## Policies" in markdown
    assert (tmp_path / "s/collected/policies/000-raster.png").is_file()


def test_without_watched_policies_there_is_no_such_section(mixed_report):
    assert not (mixed_report / "collected/policies.json").exists()
    assert "policies" not in (mixed_report / "report/index.html").read_text()
    assert "Policies" not in (mixed_report / "report/report.md").read_text()
