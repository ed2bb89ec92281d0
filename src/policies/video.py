"""The simulator as a film: frames by whatever the machine can render with, encoded by a pip-installed ffmpeg.

Gymnasium's own ``RecordVideo`` keeps all frames of an episode in memory, about 700 MB for 1,000 steps, and needs
moviepy, which does not go with our Pillow. Frames go to the encoder one by one here.
"""

from __future__ import annotations

import importlib.util
import math
import os
import subprocess
import sys
from collections.abc import Generator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from src.config.schema import EnvConfig
from src.training.gym_task import make_gym

SIZE = 480  # pixels, both ways
BACKENDS = ("egl", "osmesa")
_PROBE = """
import gymnasium, warnings
warnings.simplefilter("ignore")
environment = gymnasium.make("Hopper-v4", render_mode="rgb_array", width=32, height=32)
environment.reset(seed=0)
assert environment.render().shape == (32, 32, 3)
"""
_CAMERA = "track"
#: A film has at most this many frames per second; of a faster task every k-th step is shown.
_MOST_FPS = 50
#: Every how many frames one is kept for the strip, and how many the strip has.
_KEEP_EVERY = 10
STRIP = 6


def unavailable() -> str | None:
    """Choose a renderer, before MuJoCo is imported: one sentence where there is none or no encoder, else None.

    The user's MUJOCO_GL, else EGL or OSMesa. Each is tried in a process of its own: a renderer that fails takes its
    process with it, and MuJoCo chooses one when it is imported, once.
    """
    if importlib.util.find_spec("imageio_ffmpeg") is None:
        return "no video: the package imageio-ffmpeg is missing (pip install '.[video]')."
    wanted = os.environ.get("MUJOCO_GL")
    for backend in (wanted,) if wanted else BACKENDS:
        environment = os.environ | {"MUJOCO_GL": backend}
        environment.pop("PYOPENGL_PLATFORM", None)
        if subprocess.run([sys.executable, "-c", _PROBE], env=environment, capture_output=True).returncode == 0:
            os.environ["MUJOCO_GL"] = backend
            return None
    tried = f"MUJOCO_GL={wanted}" if wanted else "EGL or OSMesa"
    return (
        f"no video: MuJoCo can't render by {tried} here; on Debian `apt-get install libegl1 libgl1-mesa-dri` "
        "(EGL) or `apt-get install libosmesa6` (OSMesa) brings what is missing."
    )


def rendering(config: EnvConfig) -> EnvConfig:
    """The task with frames, from the camera that follows the body where its model has one."""
    kwargs: dict[str, Any] = {"render_mode": "rgb_array", "width": SIZE, "height": SIZE}
    with closing(make_gym(config)) as environment:
        model = environment.unwrapped.model  # type: ignore[attr-defined]
        if _CAMERA in (model.camera(index).name for index in range(model.ncam)):
            kwargs["camera_name"] = _CAMERA
    return replace(config, kwargs=config.kwargs | kwargs)


def _draw_floor_without_end(environment: gymnasium.Env) -> None:
    """A runner leaves the floor as it is drawn; contacts know it as a plane without end in any case."""
    import mujoco  # which chooses its renderer when it is imported: not before one was chosen

    model = environment.unwrapped.model  # type: ignore[attr-defined]
    model.geom_size[model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE, :2] = 0.0


class Film:
    """Frames of an environment into ``episode.mp4``, and some of them into a strip; a context manager.

    Args:
        environment: made of :func:`rendering`.
        path: the video.
    """

    def __init__(self, environment: gymnasium.Env, path: Path) -> None:
        self._environment, self._path = environment, path
        _draw_floor_without_end(environment)
        fps = environment.metadata.get("render_fps", _MOST_FPS)
        self._every = math.ceil(fps / _MOST_FPS)
        self._fps = fps / self._every
        self._kept: list[np.ndarray] = []
        self._writer: Generator[None, bytes, None] | None = None
        self._font = ImageFont.load_default(size=22)

    def __enter__(self) -> Film:
        import imageio_ffmpeg

        self._writer = imageio_ffmpeg.write_frames(
            str(self._path),
            (SIZE, SIZE),
            fps=self._fps,
            macro_block_size=1,
            output_params=["-movflags", "+faststart"],
            ffmpeg_log_level="error",
        )
        self._writer.send(None)  # type: ignore[arg-type]
        return self

    def __exit__(self, *_: object) -> None:
        assert self._writer is not None
        self._writer.close()

    def take(self, step: int, episode_return: float) -> None:
        """Render, write return and step on it, encode."""
        assert self._writer is not None
        if step % self._every:
            return
        frame = Image.fromarray(np.asarray(self._environment.render()))
        draw = ImageDraw.Draw(frame)
        text = f"step {step}   return {episode_return:,.0f}"
        draw.text((10, SIZE - 36), text, font=self._font, fill="white", stroke_width=2, stroke_fill="black")
        picture = np.asarray(frame)
        self._writer.send(np.ascontiguousarray(picture).tobytes())
        if step // self._every % _KEEP_EVERY == 0:
            self._kept.append(picture)

    def save_strip(self, path: Path) -> None:
        """Six frames of the episode, the first to the last kept, side by side at half size."""
        indices = np.linspace(0, len(self._kept) - 1, STRIP).round().astype(int)
        half = SIZE // 2
        strip = Image.new("RGB", (half * STRIP, half))
        for place, index in enumerate(indices):
            strip.paste(Image.fromarray(self._kept[index]).resize((half, half)), (place * half, 0))
        strip.save(path)
