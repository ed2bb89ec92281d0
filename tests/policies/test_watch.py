"""If these fail, what a person sees of a policy is not what the policy does."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from src import evaluate, watch
from src.policies import raster, summary, video
from src.policies.episode import Episode, Population, play_episode
from src.training.gym_task import make_gym
from src.training.policy_file import load_policy
from tests.helpers import tiny
from tests.training.test_session import run


def played(path: Path, decisions: int = 5) -> Episode:
    trained = load_policy(path)
    return play_episode(trained, make_gym(trained.config.env), seed=3, decisions=decisions)


def test_the_episode_is_the_one_that_evaluate_plays(tiny_run: Path) -> None:
    """Watched on the plain path and evaluated on the engine: products of another BLAS may differ in their last bits."""
    episode = played(tiny_run / "policy.pt")
    kept, ((total, length),) = evaluate.play(tiny_run / "policy.pt", episodes=1, seed=3)
    assert kept.startswith("policy of step ")
    assert (total, length) == (pytest.approx(episode.episode_return, rel=1e-6), len(episode.rewards))


def test_what_is_shown_are_spikes_of_every_time_step_and_rates_of_every_decision(tiny_run: Path) -> None:
    episode = played(tiny_run / "policy.pt")
    sizes = {population.name: population.rates.shape for population in episode.populations}
    assert sizes == {"input": (60, 170), "layer1": (60, 32), "layer2": (60, 32), "layer3": (60, 60)}
    for population in episode.populations:
        assert population.spiking and population.first.shape[0] == 5 * population.time_steps
        assert set(np.unique(population.first)) <= {0.0, 1.0}
        np.testing.assert_allclose(population.first.reshape(5, 5, -1).mean(1), population.rates[:5], rtol=1e-6)
    assert episode.operations is not None and episode.operations.decisions == 60


def test_without_video_raster_and_text_are_there_and_the_same_each_time(tiny_run: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert watch.main([str(tiny_run), "--no-video", "--output", str(tmp_path / name)]) == 0
    names = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert names == ["raster.pdf", "raster.png", "summary.txt"]
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name
    assert "operations per decision" in (tmp_path / "a" / "summary.txt").read_text()


def test_an_actor_without_spikes_can_be_watched_too(tmp_path: Path) -> None:
    path = run(tiny(tmp_path, actor="aan"))[1]
    assert watch.main([str(path), "--no-video"]) == 0
    assert (path / "watch" / "raster.png").stat().st_size > 10_000


def test_the_text_counts_neurons_that_are_always_and_never_on() -> None:
    rates = np.array([[1.0, 0.0, 0.4, 0.0], [1.0, 0.0, 0.6, 1.0]])
    lines = summary._populations([Population("layer1", True, 5, rates, rates)])
    assert lines[1].split() == ["layer1", "4", "0.500", "25.0%", "25.0%"]


def test_a_missing_encoder_is_one_sentence_and_the_raster_is_written(
    tiny_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert watch.main([str(tiny_run), "--output", str(tmp_path)]) == 0
    assert "imageio-ffmpeg is missing" in capsys.readouterr().out
    assert (tmp_path / "raster.png").exists() and not (tmp_path / "episode.mp4").exists()


def test_where_nothing_renders_the_packages_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: name)
    assert re.search("MUJOCO_GL=disabled.*libegl1.*libosmesa6", video.unavailable() or "")


def test_the_camera_follows_the_body(tmp_path: Path) -> None:
    """Gymnasium's own stays where the episode begins: a cheetah that runs is soon out of the picture."""
    assert video.rendering(tiny(tmp_path, env="halfcheetah").env).kwargs["camera_name"] == "track"


def test_the_floor_has_no_end_in_the_film_and_is_the_same_to_the_body(tmp_path: Path) -> None:
    """A cheetah that has learnt to run is soon beyond the floor as Gymnasium draws it."""
    config = tiny(tmp_path, env="halfcheetah").env
    plain, filmed = video.make_gym(config), video.make_gym(config)
    video.Film(filmed, tmp_path / "episode.mp4")
    model = filmed.unwrapped.model
    assert model.geom("floor").size[:2].tolist() == [0.0, 0.0] and plain.unwrapped.model.geom("floor").size[0] > 0
    for each in (plain, filmed):
        each.reset(seed=0)
        each.unwrapped.set_state(each.unwrapped.data.qpos + np.eye(9)[0] * 1000, each.unwrapped.data.qvel)
    for _ in range(30):
        assert all(np.array_equal(a, b) for a, b in zip(*(each.step(np.ones(6))[:2] for each in (plain, filmed))))


def test_the_film_has_a_frame_for_every_step(tiny_run: Path, tmp_path: Path) -> None:
    """In a process of its own: MuJoCo chooses its renderer when it is imported."""
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    if without := video.unavailable():
        pytest.skip(without)
    command = [sys.executable, "-m", "src.watch", str(tiny_run), "--output", str(tmp_path)]
    subprocess.run(command, check=True, capture_output=True)
    frames, _ = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "episode.mp4"))
    assert frames == 61  # HalfCheetah has 20 frames per second: none is left out
    strip = np.asarray(Image.open(tmp_path / "frames.png")).astype(int)
    brown = [int((p[..., 0] - p[..., 2] > 60).sum()) for p in np.split(strip, video.STRIP, axis=1)]
    assert min(brown) > 100, f"pixels of the body's colour in each frame: {brown}"


def test_the_raster_needs_no_populations() -> None:
    """An actor that can't be looked into still shows its actions and rewards."""
    figure = raster.draw(Episode(np.zeros((30, 2)), np.zeros(30)), "opaque")
    assert len(figure.axes) == 5  # two columns of two, and the bar of the actions


def test_analog_input_is_shown_once_a_decision_and_its_neurons_at_every_step(tmp_path: Path) -> None:
    path = run(tiny(tmp_path, actor="mdcsan", env="halfcheetah"))[1]
    first, *layers = played(path / "policy.pt").populations
    assert (first.spiking, first.time_steps, first.first.shape) == (False, 1, (5, 170))
    assert all(layer.spiking and layer.first.shape[0] == 5 * 5 for layer in layers)
