"""If this fails, a reader with weak eyes cannot read a part of the report."""

import re
from pathlib import Path

import pytest

CSS = (Path(__file__).resolve().parents[2] / "analysis/templates/report.css").read_text()
PAIRS = (
    ("ink", "paper"), ("quiet", "paper"), ("link", "paper"), ("ink", "head"), ("quiet", "head"), ("good", "good-paper"),
    ("bad", "bad-paper"), ("plain", "plain-paper"),
)  # fmt: skip


def colours(start):
    """The variables of the ``:root`` block that begins after ``start``."""
    block = re.search(r":root \{(.*?)\}", CSS[CSS.index(start) :], flags=re.S).group(1)
    return dict(re.findall(r"--([a-z-]+): #([0-9a-f]{6})", block))


def luminance(colour):
    parts = [int(colour[k : k + 2], 16) / 255 for k in (0, 2, 4)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return sum(weight * c for weight, c in zip((0.2126, 0.7152, 0.0722), linear))


@pytest.mark.parametrize("mode", [":root", "@media (prefers-color-scheme: dark)", "@media print"])
def test_text_stands_out_from_its_ground(mode):
    found = colours(mode)
    for ink, ground in PAIRS:
        light, dark = sorted((luminance(found[ink]), luminance(found[ground])), reverse=True)
        assert (light + 0.05) / (dark + 0.05) >= 4.5, (mode, ink, ground)
