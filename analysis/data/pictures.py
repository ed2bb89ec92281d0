"""Pictures that lie beside runs, checked before they are decoded and made small enough for a page."""

from __future__ import annotations

import io
import stat
import warnings
from pathlib import Path
from typing import NamedTuple

from PIL import Image

from analysis.data.errors import UnreadableRunError
from analysis.data.files import MEGABYTE

#: Wider pictures are scaled down to so many pixels, and what is then twice as high, to that height.
WIDTH = 1200
#: The palette is chosen from so many pixels across and down: of noise it would take minutes from all.
_SAMPLE = 400
_MEGABYTES = 16
_MEGAPIXELS = 40


class Picture(NamedTuple):
    """A PNG and its size in pixels."""

    content: bytes
    width: int
    height: int


def small_picture(path: Path) -> Picture:
    """A PNG file as a PNG of at most ``WIDTH`` pixels across and 256 colours, on white.

    Raises:
        FileNotFoundError: there is none.
        UnreadableRunError: no file, too large, or no picture; says which.
    """
    about = path.stat()
    if not stat.S_ISREG(about.st_mode):
        raise UnreadableRunError(f"its {path.name} is not a file")
    if about.st_size > _MEGABYTES * MEGABYTE:
        raise UnreadableRunError(f"its {path.name} has more than {_MEGABYTES} MB")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(path, formats=("PNG",)) as image:  # reads the header only
                width, height = image.size
                if width * height > _MEGAPIXELS * 1_000_000:
                    raise Image.DecompressionBombWarning
                return _shrunk(image)
    except (Image.DecompressionBombWarning, Image.DecompressionBombError):
        raise UnreadableRunError(f"its {path.name} has more than {_MEGAPIXELS} million pixels") from None
    except Exception as error:  # whatever a decoder makes of somebody else's bytes costs this picture only
        raise UnreadableRunError(f"its {path.name} cannot be read as a PNG ({type(error).__name__})") from None


def _shrunk(image: Image.Image) -> Picture:
    rgba = image.convert("RGBA")
    white = Image.new("RGBA", rgba.size, "white")
    flat = Image.alpha_composite(white, rgba).convert("RGB")
    flat.thumbnail((WIDTH, 2 * WIDTH), Image.Resampling.LANCZOS)
    sample = flat.copy()
    sample.thumbnail((_SAMPLE, _SAMPLE), Image.Resampling.NEAREST)
    # MAXCOVERAGE keeps the rare colours, such as the ends of a colour bar; k-means then fits the common ones
    palette = sample.quantize(256, method=Image.Quantize.MAXCOVERAGE, kmeans=1)
    content = io.BytesIO()
    flat.quantize(palette=palette, dither=Image.Dither.NONE).save(content, format="PNG", optimize=True)
    return Picture(content.getvalue(), flat.width, flat.height)
