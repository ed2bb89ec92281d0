"""The loop: Spinning Up's counts, exact resume, independence of the streams. If these fail, no curve can be redone."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
import torch

from src.config.identity import Run
from src.config.schema import ExperimentConfig
from src.experiment.ownership import acquire
from src.experiment.state import Outcome
from src.training.checkpoint import CorruptState, checkpoint_paths, read_archive
from src.training.numerics import record_blas, set_numerics
from src.training.session import TrainingSession
from tests.helpers import Silent, tiny

CASES = [
    ("sac", "bptsan", "poisson", "hopper"),
    ("td3", "bptsan_wo_ndt", "deterministic", "ant"),
    ("sac", "aan", "task", "halfcheetah"),
    ("td3", "aan", "task", "hopper"),
    ("td3_proxy", "popsan", "poisson", "hopper"),
    ("td3", "popdan", "task", "hopper"),
    ("sac", "mdcsan", "task", "halfcheetah"),
    ("td3", "ilcsan", "poisson", "hopper"),
    ("td3", "lif_san", "deterministic", "halfcheetah"),
]


def run(config: ExperimentConfig, stop_at: Callable[[int], bool] = lambda step: False) -> tuple[Outcome, Path]:
    progress = Silent()
    set_numerics(config.threads)
    with acquire(Run(config)) as (directory, _):
        session = TrainingSession(config, directory, progress)
        outcome = session.loop(lambda: stop_at(session.step))
        return outcome, directory.path


def final_weights(path: Path) -> dict[str, torch.Tensor]:
    return read_archive(path / "policy.pt")["actor"]


def learner_state(path: Path) -> dict:
    return read_archive(checkpoint_paths(path / "state")[0])


def assert_same(a: object, b: object, where: str = "") -> None:
    if isinstance(a, torch.Tensor):
        assert torch.equal(a, b), where  # type: ignore[arg-type]
    elif isinstance(a, dict):
        assert a.keys() == b.keys(), where  # type: ignore[attr-defined]
        for key in a:
            if not (where == "" and key == "interval_seconds"):
                assert_same(a[key], b[key], f"{where}/{key}")  # type: ignore[index]
    elif isinstance(a, list):
        for i, (x, y) in enumerate(zip(a, b, strict=True)):  # type: ignore[call-overload]
            assert_same(x, y, f"{where}/{i}")
    else:
        assert a == b, where


@pytest.mark.parametrize("algo,actor,encoder,env", CASES)
def test_a_run_stopped_anywhere_equals_one_never_stopped(
    tmp_path: Path, algo: str, actor: str, encoder: str, env: str
) -> None:
    choices = {"algo": algo, "actor": actor, "encoder": encoder, "env": env}
    whole, whole_path = run(tiny(tmp_path / "whole", **choices))
    assert whole.status == "complete"
    config = tiny(tmp_path / "stopped", **choices)
    for stop in (50, 150, 250, 300):  # before the first checkpoint, on one, between two, in mid-episode
        outcome, _ = run(config, lambda step, stop=stop: step == stop)
        assert outcome == Outcome("interrupted", stop, outcome.message)
    outcome, stopped_path = run(config)
    assert outcome.status == "complete"
    assert (whole_path / "evaluations.csv").read_bytes() == (stopped_path / "evaluations.csv").read_bytes()
    assert_same(final_weights(whole_path), final_weights(stopped_path))
    assert_same(learner_state(whole_path), learner_state(stopped_path))
    best, resumed_best = (read_archive(path / "policy_best.pt") for path in (whole_path, stopped_path))
    assert_same(best["actor"], resumed_best["actor"])
    means = pd.read_csv(whole_path / "evaluations.csv").groupby("step")["return"].mean()
    assert best["step"] == resumed_best["step"] == means.idxmax()
    assert best["evaluation_return"] == pytest.approx(means.max())
    drop = ["steps_per_second"]
    pd.testing.assert_frame_equal(
        pd.read_csv(whole_path / "training.csv").drop(columns=drop),
        pd.read_csv(stopped_path / "training.csv").drop(columns=drop),
    )


def test_the_best_policy_is_kept_only_where_it_is_asked_for(tmp_path: Path) -> None:
    _, path = run(replace(tiny(tmp_path, actor="aan"), keep_best=False))
    assert (path / "policy.pt").exists() and not (path / "policy_best.pt").exists()


def test_a_resume_on_another_blas_is_noted_and_one_on_the_same_is_not(tmp_path: Path) -> None:
    config, progress = tiny(tmp_path, actor="aan"), Silent()
    with acquire(Run(config)) as (directory, _):
        record_blas(directory, progress, "fast")
        record_blas(directory, progress, "fast")
        recorded = directory.manifest.blas
        assert directory.manifest.notes == [] and set(recorded) == {"library", "version", "architecture"}
        directory.update_manifest(blas=recorded | {"version": "0.1", "architecture": "Z80"})
        record_blas(directory, progress, "fast")
        (note,) = directory.manifest.notes
        assert "another BLAS" in note and "Z80" in note and note in progress.notes
        assert directory.manifest.blas == recorded


@pytest.mark.parametrize("algo", ["td3", "sac"])
def test_a_run_on_the_plain_backend_says_so_and_resumes_exactly(tmp_path: Path, algo: str) -> None:
    """The optimizers' state of PyTorch goes through a checkpoint and back."""
    config = replace(tiny(tmp_path / "whole", algo=algo, actor="bptsan"), backend="plain")
    _, whole_path = run(config)
    config = replace(config, results_dir=str(tmp_path / "stopped"))
    run(config, lambda step: step == 300)
    _, stopped_path = run(config)
    assert_same(learner_state(whole_path), learner_state(stopped_path))
    assert json.loads((stopped_path / "manifest.json").read_text())["backend"] == "plain"


def test_rows_written_after_the_last_checkpoint_are_redone_not_doubled(tmp_path: Path) -> None:
    _, whole_path = run(tiny(tmp_path / "whole", actor="aan"))
    config = tiny(tmp_path / "killed", actor="aan")
    run(config, lambda step: step == 350)
    path = Run(config).path
    with (path / "evaluations.csv").open("a") as file:  # a kill after the evaluation and before its checkpoint
        file.write("450,0,1.0,2\n450,1,1.0")
    run(config)
    assert (whole_path / "evaluations.csv").read_bytes() == (path / "evaluations.csv").read_bytes()


def test_a_truncated_checkpoint_falls_back_to_the_one_before_with_the_same_numbers(tmp_path: Path) -> None:
    _, whole_path = run(tiny(tmp_path / "whole", actor="aan"))
    config = tiny(tmp_path / "cut", actor="aan")
    run(config, lambda step: step == 400)
    path = Run(config).path
    newest = checkpoint_paths(path / "state")[0]
    assert newest.name.endswith("400.pt")
    newest.write_bytes(newest.read_bytes()[:-100])
    progress = Silent()
    with acquire(Run(config)) as (directory, _):
        TrainingSession(config, directory, progress).loop(lambda: False)
    assert any("passed over" in note and "truncated" in note for note in progress.notes)
    assert "resumed at step 300" in progress.notes
    assert (whole_path / "evaluations.csv").read_bytes() == (path / "evaluations.csv").read_bytes()
    assert_same(final_weights(whole_path), final_weights(path))


def test_two_corrupt_checkpoints_are_refused_and_the_evaluations_stay(tmp_path: Path) -> None:
    config = tiny(tmp_path, actor="aan")
    run(config, lambda step: step == 400)
    path = Run(config).path
    rows = (path / "evaluations.csv").read_bytes()
    for checkpoint in checkpoint_paths(path / "state"):
        data = bytearray(checkpoint.read_bytes())
        data[len(data) // 2] ^= 1
        checkpoint.write_bytes(data)
    with pytest.raises(CorruptState, match="on_conflict=replace"):
        run(config)
    assert (path / "evaluations.csv").read_bytes() == rows


def test_a_complete_run_is_extended_to_what_the_longer_run_would_have_been(tmp_path: Path) -> None:
    longer = {"protocol.total_steps": 600}
    _, whole_path = run(tiny(tmp_path / "whole", longer, actor="popsan"))
    run(tiny(tmp_path / "extended", {"keep_replay": True}, actor="popsan"))
    _, extended_path = run(tiny(tmp_path / "extended", longer | {"keep_replay": True}, actor="popsan"))
    assert (whole_path / "evaluations.csv").read_bytes() == (extended_path / "evaluations.csv").read_bytes()


def test_spinning_ups_update_counts(tmp_path: Path) -> None:
    """Updates begin after step update_after + 50; 1M steps would give 999,000 and 499,500."""
    outcome, path = run(tiny(tmp_path, {"protocol.update_after": 100}, actor="aan"))
    learner = learner_state(path)["learner"]
    assert outcome.step == 450
    assert learner["critic_updates"] == 450 - 100
    assert learner["actor_updates"] == (450 - 100) // 2
    training = pd.read_csv(path / "training.csv")
    assert training["step"].tolist() == [150, 300, 450]
    assert training["critic_updates"].tolist() == [50, 200, 350]


def test_the_initial_policy_is_evaluated_and_the_episodes_are_those_asked_for(tmp_path: Path) -> None:
    _, path = run(tiny(tmp_path, actor="aan"))
    table = pd.read_csv(path / "evaluations.csv")
    assert table["step"].unique().tolist() == [0, 150, 300, 450]
    assert (table.groupby("step").size() == 2).all()
    assert table["length"].between(1, 60).all()


def test_the_rate_shown_right_after_an_evaluation_is_not_zero(tmp_path: Path) -> None:
    with acquire(Run(tiny(tmp_path, actor="aan"))) as (directory, _):
        progress = Silent()
        TrainingSession(tiny(tmp_path, actor="aan"), directory, progress).loop(lambda: False)
    assert len(progress.rates) == 9 and min(progress.rates) > 0


def test_evaluating_more_often_moves_no_training_number(tmp_path: Path) -> None:
    _, rare = run(tiny(tmp_path / "rare", {"protocol.evaluation_interval": 450}))
    _, often = run(tiny(tmp_path / "often", {"protocol.evaluation_interval": 50, "protocol.evaluation_episodes": 1}))
    assert_same(final_weights(rare), final_weights(often))


def test_the_global_generators_are_never_drawn_from(tmp_path: Path) -> None:
    """A number drawn from a global generator would not survive a resume."""
    import random

    import numpy as np

    before = torch.get_rng_state(), np.random.get_state()[1].copy(), random.getstate()  # type: ignore[index]
    run(tiny(tmp_path, algo="sac"))
    assert torch.equal(before[0], torch.get_rng_state())
    assert (before[1] == np.random.get_state()[1]).all()  # type: ignore[index]
    assert before[2] == random.getstate()


def test_another_seed_moves_everything(tmp_path: Path) -> None:
    _, one = run(tiny(tmp_path, {"seed": 1}))
    _, two = run(tiny(tmp_path, {"seed": 2}))
    assert (one / "evaluations.csv").read_bytes() != (two / "evaluations.csv").read_bytes()
    a, b = final_weights(one), final_weights(two)
    assert all(not torch.equal(a[k], b[k]) for k in a if "mean" not in k and "std" not in k)


def test_non_finite_numbers_end_the_run_as_diverged_with_the_step(tmp_path: Path) -> None:
    outcome, _ = run(tiny(tmp_path, {"algo.critic_learning_rate": 1e30}, actor="aan"))
    assert outcome.status == "diverged"
    assert str(outcome.step) in outcome.message and outcome.step < 450


def test_updates_see_observations_normalised_by_all_blocks_so_far(tmp_path: Path) -> None:
    """Acting, evaluating and sampling use the same statistics; those of a burst include the block just collected."""
    config = tiny(tmp_path, actor="aan")
    bursts = []
    with acquire(Run(config)) as (directory, _):
        session = TrainingSession(config, directory, Silent())
        learn = session.learner.learn
        session.learner.learn = lambda burst: (bursts.append(burst), learn(burst))[1]  # type: ignore[method-assign,func-returns-value]
        session.loop(lambda: session.step == 150)
        stored = session.replay.log.get(torch.arange(150))
    observations, next_observations = stored[0].double(), stored[3].double()
    assert len(observations) == 150 and len(bursts) == 1
    mean, variance = observations.mean(0), observations.var(0, correction=0)
    for seen, raw in ((bursts[0].observation, observations), (bursts[0].next_observation, next_observations)):
        expected = ((raw - mean) / (variance + 1.2e-7).sqrt()).clamp(-3, 3).float()
        distance = (
            torch.cdist(seen.flatten(0, 1), expected, compute_mode="donot_use_mm_for_euclid_dist").min(dim=1).values
        )
        assert float(distance.max()) < 1e-3
