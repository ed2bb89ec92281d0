"""Synthetic studies with a known truth, written exactly as ``docs/run-directory.md`` says. Only ever in temporary
folders.
"""

from __future__ import annotations

import copy
import hashlib
import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from benchmarks.configuration import compose
from src.config.validation import to_dict

CONF = Path(__file__).resolve().parents[1] / "conf"
SIZES = {"hopper": (11, 3), "walker2d": (17, 6), "halfcheetah": (17, 6), "ant": (111, 8)}
LEVELS = {"hopper": 3000.0, "walker2d": 3500.0, "halfcheetah": 9000.0, "ant": 4000.0}
ACTORS = ("aan", "popsan", "bptsan_wo_ndt", "bptsan_wo_li", "bptsan")


@cache
def _paper(algo: str, env: str, actor: str) -> dict[str, Any]:
    return to_dict(compose(algo=algo, env=env, actor=actor, protocol="short", logger="none"))


def configuration(
    algo: str, env: str, actor: str, seed: int = 0, total_steps: int = 100_000, interval: int = 10_000, **changes: Any
) -> dict[str, Any]:
    """A resolved configuration as ``config.yaml`` holds it, from the project's own ``conf``; ``changes`` by dotted
    key.
    """
    config = copy.deepcopy(_paper(algo, env, actor))
    protocol = {"total_steps": total_steps, "evaluation_interval": interval, "evaluation_episodes": 2}
    keys = {f"protocol.{key}": value for key, value in protocol.items()} | {"seed": seed, "study": "x", "label": None}
    for key, value in (keys | changes).items():
        *parents, last = key.split(".")
        node = config
        for parent in parents:
            node = node[parent]
        node[last] = value
    return config


def _hash(config: dict[str, Any]) -> str:
    kept = {k: v for k, v in config.items() if k not in ("seed", "study", "label")}
    kept["protocol"] = {k: v for k, v in kept["protocol"].items() if k != "total_steps"}
    return hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()


def write_run(
    study: Path,
    algo: str = "td3",
    env: str = "hopper",
    actor: str = "bptsan",
    seed: int = 0,
    *,
    level: float | None = None,
    total_steps: int = 100_000,
    interval: int = 10_000,
    status: str = "complete",
    stop: int | None = None,
    label: str | None = None,
    changes: dict[str, Any] | None = None,
    curve: np.ndarray | None = None,
    noise: float = 0.0,
    manifest: dict[str, Any] | None = None,
    encoder: str | None = None,
) -> Path:
    """Write one run and give its folder. ``curve``: the returns by evaluation; else a saturating curve towards
    ``level``.

    ``stop``: the step of the last evaluation. Two episodes an evaluation, their mean is the curve's value.
    """
    changes = changes or {}
    config = configuration(algo, env, actor, seed, total_steps, interval, **changes)
    if encoder:
        config["encoder"]["coding"] = encoder
    coding, label = config["encoder"]["coding"], label or actor
    path = study / "runs" / algo / env / label / coding / f"seed_{seed}"
    path.mkdir(parents=True)
    (path / "config.yaml").write_text(yaml.safe_dump(config, sort_keys=False))
    last = total_steps if stop is None else stop
    steps = np.arange(0, last + 1, interval)
    generator = np.random.default_rng([seed, len(label), len(env), *label.encode()])
    if curve is None:
        top = LEVELS[env] if level is None else level
        curve = top * (1 - np.exp(-5 * steps / total_steps)) + noise * generator.standard_normal() * np.linspace(
            0, 1, len(steps)
        )
        curve = curve + 0.2 * noise * generator.standard_normal(len(steps))
    rows = ["step,episode,return,length"]
    for step, value in zip(steps.tolist(), np.asarray(curve, dtype=float).tolist()):
        rows += [
            f"{step},{episode},{value + sign!r},{1000 if value > 500 else 200}"
            for episode, sign in ((0, 1.0), (1, -1.0))
        ]
    (path / "evaluations.csv").write_text("\n".join(rows) + "\n")
    (path / "training.csv").write_text(_training(steps[1:], algo, actor, generator))
    n, m = SIZES[env]
    content = {
        "format": 1,
        "status": status,
        "algo": algo,
        "env": env,
        "actor": actor,
        "label": label,
        "encoder": coding,
        "seed": seed,
        "study": study.name,
        "changed_keys": {k: v for k, v in changes.items() if k.split(".")[0] in ("actor", "encoder", "algo")},
        "configuration_hash": hashlib.sha256(f"{_hash(config)}{seed}".encode()).hexdigest(),
        "cell_hash": _hash(config),
        "engine": 1,
        "step": int(last),
        "total_steps": total_steps,
        "observation_size": n,
        "action_size": m,
        "parameters": {"actor": 71_000, "critic": 140_000},
        "started": "2026-01-01T00:00:00+00:00",
        "updated": "2026-01-01T01:00:00+00:00",
        "finished": "2026-01-01T01:00:00+00:00",
        "wall_time_seconds": 3600.0 + seed,
        "times_resumed": 0,
        "versions": {"python": "3.11.7", "torch": "2.13.0", "mujoco": "4.0.0"},
        "commit": "0" * 40,
        "dirty": False,
        "processor": "Example CPU",
        "threads": 1,
        "device": "cpu",
        "failure": None,
        "notes": [],
    }
    content |= manifest or {}
    (path / "manifest.json").write_text(json.dumps(content, indent=1))
    return path


def _training(steps: np.ndarray, algo: str, actor: str, generator: np.random.Generator) -> str:
    columns: dict[str, Any] = {"step": steps, "critic_updates": steps, "actor_updates": steps // 2}
    for name in ("critic_loss", "actor_loss", "q1", "q2"):
        columns[name] = generator.normal(10, 1, len(steps))
    columns["log_probability"] = generator.normal(-3, 0.1, len(steps)) if algo == "sac" else [""] * len(steps)
    for name in ("actor_gradient_norm", "training_return"):
        columns[name] = generator.normal(5, 0.1, len(steps))
    columns["steps_per_second"] = generator.normal(100, 1, len(steps))
    if actor != "aan":
        columns["input_firing_rate"] = np.full(len(steps), 0.2)
        for layer, rate in ((1, 0.3), (2, 0.25), (3, 0.4)):
            drift = np.linspace(0, 0.1, len(steps))
            columns |= {
                f"layer{layer}_firing_rate": rate + drift,
                f"layer{layer}_window_share": 0.5 - drift,
                f"layer{layer}_always_on": drift / 2,
                f"layer{layer}_never_on": 0.1 - drift / 2,
                f"layer{layer}_gradient_norm": 1 + drift,
            }
    lines = [",".join(columns)]
    lines += [",".join(str(columns[name][i]) for name in columns) for i in range(len(steps))]
    return "\n".join(lines) + "\n"


def write_grid(
    study: Path,
    effects: dict[str, float] | None = None,
    *,
    algos: tuple[str, ...] = ("td3",),
    envs: tuple[str, ...] = ("hopper",),
    actors: tuple[str, ...] = ACTORS,
    seeds: int = 5,
    noise: float = 100.0,
    total_steps: int = 100_000,
    interval: int = 10_000,
) -> Path:
    """A whole grid; ``effects``: what an actor adds to its task's level."""
    for algo in algos:
        for env in envs:
            for actor in actors:
                for seed in range(seeds):
                    level = LEVELS[env] + (effects or {}).get(actor, 0.0)
                    write_run(
                        study,
                        algo,
                        env,
                        actor,
                        seed,
                        level=level,
                        noise=noise,
                        total_steps=total_steps,
                        interval=interval,
                    )
    return study


def write_operations(
    run: Path,
    *,
    macs: float,
    acs: float,
    updates: float = 0.0,
    dense: float = 100_000.0,
    weights: int = 1000,
    zero_weights: int = 0,
) -> None:
    """An ``operations.json`` with one layer of MACs and one of ACs, as ``docs/run-directory.md`` says."""
    layers = [
        {
            "name": name,
            "kind": kind,
            "dense": dense,
            "effective": effective,
            "weights": weights,
            "zero_weights": zero_weights,
        }
        for name, kind, effective in (("first", "MAC", macs), ("second", "AC", acs))
    ]
    content = {
        "decisions": 2000,
        "episodes": 10,
        "layers": layers,
        "neuron_updates": updates,
        "neurons": 542,
        "encoder_exponentials": 110.0 if updates else 0.0,
        "random_numbers": 0.0,
        "activation_sparsity": 0.75,
        "footprint_bytes": 400_000,
    }
    (run / "operations.json").write_text(json.dumps(content))
