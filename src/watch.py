"""See a trained policy: ``python -m src.watch RUN`` plays one episode and writes what there is to see.

Into RUN/watch: episode.mp4 (the simulator, with step and return), frames.png (six of its frames), raster.png and
raster.pdf (spikes, firing rates, actions, reward) and summary.txt. Where nothing renders, one sentence says which
package is missing, and the rest is written. Relative paths lie in the repository, whatever the working directory.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from src.experiment.run_directory import WATCH_FOLDER
from src.paths import repository_path, shown_path
from src.policies.command import parse, policy_parser, policy_path, run_command


def main(arguments: Sequence[str] | None = None) -> int:
    """Play, write, say where; returns the exit code."""
    parser = policy_parser("watch", __doc__)
    parser.add_argument("--seed", type=int, default=0, help="seed of the episode (default: 0)")
    parser.add_argument("--decisions", type=int, default=20, help="decisions shown spike by spike (default: 20)")
    parser.add_argument("--output", type=repository_path, help="folder (default: watch, beside the policy file)")
    parser.add_argument("--no-video", action="store_true", help="the raster and the text only")
    options = parse(parser, arguments, seed=0, decisions=1)

    def work() -> None:
        path = policy_path(options.run, options.policy)
        folder = options.output or (options.run if options.run.is_dir() else path.parent) / WATCH_FOLDER
        folder.mkdir(parents=True, exist_ok=True)
        print(watch(path, folder, options.seed, options.decisions, not options.no_video), end="")

    return run_command(work)


def watch(path: Path, folder: Path, seed: int, decisions: int, video: bool) -> str:
    """Write everything into the folder; returns the text of ``summary.txt`` and what was written."""
    from src.policies.video import Film, rendering, unavailable

    without = unavailable() if video else None
    video = video and without is None

    from src.policies import raster, summary
    from src.policies.episode import play_episode
    from src.training.gym_task import make_gym
    from src.training.policy_file import load_policy

    trained = load_policy(path)
    config = trained.config
    written = []
    with closing(make_gym(rendering(config.env) if video else config.env)) as environment:
        if video:
            written = [folder / "episode.mp4", folder / "frames.png"]
            with Film(environment, written[0]) as film:
                episode = play_episode(trained, environment, seed, decisions, film.take)
            film.save_strip(written[1])
        else:
            episode = play_episode(trained, environment, seed, decisions)
    heading = summary.title(config.label or config.actor.name, config.env.id, episode)
    written += raster.save(raster.draw(episode, heading), folder)
    text = summary.text(heading, trained.record, seed, episode)
    (folder / "summary.txt").write_text(text)
    lines = [*([without] if without else []), *(f"wrote {shown_path(file)}" for file in written)]
    return text + "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())
