"""Our spiking actors against the same actors as plain step-by-step eager PyTorch, in the same training loop."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from pathlib import Path

from benchmarks import race as races
from benchmarks.our_loop import ours
from benchmarks.race import Race
from benchmarks.relay import Racer, in_turns
from benchmarks.topic import Row, Topic

GOALS = {"popsan": 2.5, "bptsan": 3.0}
FULL = Race(warm_up=500, window=200, rounds=4, episode_length=50)
QUICK = Race(warm_up=100, window=50, rounds=1, episode_length=10)


def topic(quick: bool = False) -> Topic:
    """PopSAN and BPT-SAN, TD3 on Hopper."""
    race = QUICK if quick else FULL
    result = Topic(
        title="step-by-step eager PyTorch",
        method=races.METHOD.format(**race._asdict())
        + " Both sides are our session; theirs has the actor (and its target) of benchmarks/stepwise.py on the plain "
        "backend: a Linear and an elementwise update per time step, gradients by autograd. Both save checkpoints.",
        columns={"actor": "actor"} | races.COLUMNS,
        goal="at least",
    )
    result.rows += [_against_reference(actor, goal, race) for actor, goal in GOALS.items()]
    return result


def _against_reference(actor: str, goal: float, race: Race) -> Row:
    with tempfile.TemporaryDirectory(prefix="benchmark-") as folder, ExitStack() as stack:
        racers = []
        for reference in (False, True):
            config = race.configuration(Path(folder) / str(reference), algo="td3", actor=actor, env="hopper")
            env = race.evaluation_env(config.env)
            racers.append(stack.enter_context(Racer(ours, config=config, evaluation_env=env, reference=reference)))
        windows = in_turns(racers, race.warm_up, race.window, race.rounds)
    length = config.env.max_episode_steps
    ours_rates, stepwise = ([races.rates(w, race, length) for w in each] for each in windows)
    return {"actor": actor, "goal": goal, **races.compared(ours_rates, stepwise)}
