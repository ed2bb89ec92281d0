"""See a trained policy: ``python -m src.watch RUN`` plays one episode and writes what there is to see.

Into RUN/watch: episode.mp4 (the simulator, with step and return), frames.png (six of its frames), raster.png and
raster.pdf (spikes, firing rates, actions, reward) and summary.txt. Where nothing renders, one sentence says which
package is missing, and the rest is written. Relative paths lie in the repository, whatever the working directory.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from src.config.schema import ConfigurationError
from src.experiment import process
from src.experiment.run_directory import WATCH_FOLDER
from src.paths import repository_path, shown_path
from src.policies.find import BEST, FINAL, policy_path


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="python -m src.watch", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=repository_path, help="a run directory, or a policy file")
    parser.add_argument("--policy", choices=(FINAL, BEST), default=FINAL, help="of a run directory (default: final)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the episode (default: 0)")
    parser.add_argument("--decisions", type=int, default=20, help="decisions shown spike by spike (default: 20)")
    parser.add_argument("--output", type=repository_path, help="folder (default: watch, beside the policy file)")
    parser.add_argument("--no-video", action="store_true", help="the raster and the text only")
    options = parser.parse_args(arguments)
    for name, least in (("seed", 0), ("decisions", 1)):
        if getattr(options, name) < least:
            parser.error(f"--{name}: should be at least {least}, found {getattr(options, name)}")
    return options


def main(arguments: Sequence[str] | None = None) -> int:
    """Play, write, say where; returns the exit code."""
    options = parse(arguments)
    try:
        path = policy_path(options.run, options.policy)
        folder = options.output or (options.run if options.run.is_dir() else path.parent) / WATCH_FOLDER
        folder.mkdir(parents=True, exist_ok=True)
        print(watch(path, folder, options.seed, options.decisions, not options.no_video), end="")
    except (ConfigurationError, RuntimeError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def watch(path: Path, folder: Path, seed: int, decisions: int, video: bool) -> str:
    """Write everything into the folder; returns the text of ``summary.txt`` and what was written."""
    process.set_threads_before_torch(1)
    from src.policies.video import choose_backend, missing_encoder, nothing_renders

    without = missing_encoder() if video else ""
    if without is None:
        backend = choose_backend()
        without = "" if backend else nothing_renders()
        if backend:  # before MuJoCo is imported
            os.environ["MUJOCO_GL"] = backend
        video = backend is not None
    else:
        video = False

    from src.policies import raster, summary
    from src.policies.episode import play_episode
    from src.policies.load import load_policy
    from src.policies.video import Film, rendering
    from src.training.gym_task import make_gym

    trained = load_policy(path)
    config = trained.config
    environment = make_gym(rendering(config.env) if video else config.env)
    written = []
    try:
        if video:
            with Film(environment, folder / "episode.mp4") as film:
                episode = play_episode(trained, environment, seed, decisions, film.take)
            film.save_strip(folder / "frames.png")
            written = [folder / "episode.mp4", folder / "frames.png"]
        else:
            episode = play_episode(trained, environment, seed, decisions)
    finally:
        environment.close()
    heading = summary.title(config.label or config.actor.name, config.env.id, episode)
    written += raster.save(raster.draw(episode, heading), folder)
    text = summary.text(heading, trained.standing, seed, episode)
    (folder / "summary.txt").write_text(text)
    lines = [*([without] if without else []), *(f"wrote {shown_path(file)}" for file in written)]
    return text + "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())
