"""Our whole loop against Stable-Baselines3's and one of TorchRL's own parts: the same networks, the same work."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from benchmarks import race as races
from benchmarks.our_loop import ours
from benchmarks.race import Race
from benchmarks.relay import Racer, in_turns
from benchmarks.sb3_loop import MISSING, installed, stable_baselines3
from benchmarks.topic import Row, Topic
from benchmarks.torchrl_loop import torchrl

GOAL = 2.0
FULL = Race(warm_up=1000, window=400, rounds=5, episode_length=200)
QUICK = Race(warm_up=100, window=50, rounds=1, episode_length=20)


def topic(quick: bool = False) -> Topic:
    """TD3 against both, SAC against Stable-Baselines3."""
    race = QUICK if quick else FULL
    result = Topic(
        title="whole loops of others",
        method=races.METHOD.format(**race._asdict())
        + " AAN, two hidden layers of 256 ReLUs, batch 100, one update per step in bursts of 50, learning rate 1e-3, "
        "on every side. The others don't normalise observations and save nothing. Stable-Baselines3 evaluates one "
        "episode after the other unless its user makes it evaluate side by side, as we and the loop of TorchRL's parts "
        "do.",
        columns={"algo": "algo", "peer": "peer"} | races.COLUMNS,
        goal="at least",
    )
    theirs: dict[str, Callable[..., None]] = {"Stable-Baselines3": stable_baselines3} if installed() else {}
    result.notes += [] if theirs else [MISSING]
    result.rows += _against("td3", theirs | {"TorchRL's parts": torchrl}, race)
    if theirs:
        result.rows += _against("sac", theirs, race)
    return result


def _against(algo: str, peers: dict[str, Callable[..., None]], race: Race) -> list[Row]:
    with tempfile.TemporaryDirectory(prefix="benchmark-") as name, ExitStack() as stack:
        folder = Path(name)
        config = race.configuration(folder, algo=algo, actor="aan", env="hopper")
        common = {"config": config, "evaluation_env": race.evaluation_env(config.env)}
        racers = [stack.enter_context(Racer(ours, **common))]
        for index, runner in enumerate(peers.values()):
            racers.append(stack.enter_context(Racer(runner, folder=folder / f"peer{index}", **common)))
        windows = in_turns(racers, race.warm_up, race.window, race.rounds)
    length = config.env.max_episode_steps
    mine = [races.rates(w, race, length) for w in windows[0]]
    rows: list[Row] = []
    for peer, each in zip(peers, windows[1:], strict=True):
        for part, name in {"evaluation": peer, "side by side": f"{peer}, side by side"}.items():
            if part in each[0].parts:
                rates = [races.rates(w, race, length, part) for w in each]
                rows.append({"algo": algo, "peer": name, "goal": GOAL, **races.compared(mine, rates)})
    return rows
