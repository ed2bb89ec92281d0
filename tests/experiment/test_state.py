"""If these fail, the same command again does the wrong thing: trains twice, mixes configurations, or leaves work."""

import json
import multiprocessing
import time

import pytest

from src.config.schema import ENGINE, ConfigurationError
from src.experiment import ownership, state
from src.experiment.ownership import BusyError, acquire
from src.experiment.plan import make_plan
from src.experiment.run_directory import Failure
from src.experiment.state import Next, next_action
from tests.experiment.runs import changed, run_of, smoke


def ended(results, *overrides, **changes):
    """A run directory as a run has left it."""
    config = smoke(results, *overrides)
    with acquire(config) as (run, _):
        run.update_manifest(**{"status": "complete", "step": 2000, **changes})
    return config, run


def test_nothing_there_is_run(tmp_path):
    assert next_action(smoke(tmp_path)).action is Next.RUN


@pytest.mark.parametrize(
    ("changes", "action"),
    [
        ({}, Next.SKIP),
        ({"status": "interrupted", "step": 1000}, Next.RESUME),
        ({"status": "running", "step": 1000}, Next.RESUME),  # its process is dead: the lock is free
        ({"status": "failed", "step": 500, "failure": Failure("OSError", "disk", 500)}, Next.RETRY),
        ({"status": "diverged", "step": 500, "failure": Failure("diverged", "nan", 500)}, Next.DIVERGED),
    ],
)
def test_the_same_configuration_again(tmp_path, changes, action):
    config, _ = ended(tmp_path, **changes)
    assert next_action(config).action is action


def test_a_larger_total_extends_and_a_smaller_one_is_refused(tmp_path):
    _, run = ended(tmp_path)
    gone = next_action(smoke(tmp_path, "protocol.total_steps=4000"))
    assert gone.action is Next.CONFLICT and "can't be extended to 4000" in gone.reason
    assert next_action(smoke(tmp_path, "protocol.total_steps=4000", "on_conflict=replace")).action is Next.REPLACE
    for name in ("replay.bin", "checkpoint-000000002000.pt"):
        (run.state / name).touch()
    assert next_action(smoke(tmp_path, "protocol.total_steps=4000")).action is Next.EXTEND
    smaller = next_action(smoke(tmp_path, "protocol.total_steps=1000"))
    assert smaller.action is Next.CONFLICT and "1000 is smaller than the 2000 steps" in smaller.reason


def test_another_configuration_is_refused_with_the_keys(tmp_path):
    ended(tmp_path)
    other = smoke(tmp_path, "protocol.update_after=300", "threads=2")
    with pytest.raises(ConfigurationError) as refused:
        make_plan([other])
    said = str(refused.value)
    assert "td3/hopper/bptsan/poisson/seed_0" in said
    assert "protocol.update_after: 200 -> 300" in said and "threads: 1 -> 2" in said
    assert all(way in said for way in ("study=", "label=", "on_conflict=replace"))
    assert "total_steps" not in said


def test_another_engine_is_refused_and_named(tmp_path, monkeypatch):
    config, _ = ended(tmp_path)
    monkeypatch.setattr("src.config.identity.ENGINE", 99)
    monkeypatch.setattr("src.experiment.state.ENGINE", 99)
    decision = next_action(changed(config))
    assert decision.action is Next.CONFLICT and f"engine: {ENGINE} -> 99" in decision.reason


def test_replace_deletes_the_old_run_only_when_the_job_starts(tmp_path):
    _, run = ended(tmp_path)
    run.evaluations.append(0, [(1.0, 5)])
    (run.state / "checkpoint").write_text("old")
    (run.state / "tensorboard").mkdir()
    other = smoke(tmp_path, "protocol.update_after=300", "on_conflict=replace")
    plan = make_plan([other])
    assert plan.runs[0].action is Next.REPLACE
    assert (run.path / "evaluations.csv").exists()
    with acquire(other) as (again, decision):
        assert decision.action is Next.REPLACE
        assert again.read_manifest().status == "running"
    assert sorted(each.name for each in run.path.iterdir()) == ["config.yaml", "manifest.json", "state"]
    assert {each.name for each in run.state.iterdir()} <= {"lock", "owner", "log.txt", "reserve"}
    assert again.read_config()["protocol"]["update_after"] == 300


def test_on_conflict_replace_leaves_a_run_of_the_same_configuration_alone(tmp_path):
    ended(tmp_path)
    assert next_action(smoke(tmp_path, "on_conflict=replace")).action is Next.SKIP


def test_a_run_with_damaged_state_starts_over_only_when_asked_to(tmp_path):
    config, run = ended(tmp_path, status="failed", step=500)
    run.update_manifest(failure=Failure("CorruptCheckpoint", "no whole checkpoint is left", 500))
    assert next_action(config).action is Next.RETRY
    assert next_action(changed(config, on_conflict="replace")).action is Next.REPLACE
    run.update_manifest(failure=Failure("OSError", "the disk is full", 500))
    assert next_action(changed(config, on_conflict="replace")).action is Next.RETRY


def test_leftovers_of_a_kill_are_removed_and_space_for_last_words_is_reserved(tmp_path):
    config, run = ended(tmp_path, status="interrupted", step=500)
    left = [
        run.path / ".manifest.json.abcd1234",
        run.path / ".policy.pt.abcd1234",
        run.state / ".checkpoint-000000000500.pt.abcd1234",
    ]
    for each in left:
        each.write_text("half")
    with acquire(config) as (again, _):
        assert not any(each.exists() for each in left)
        assert (again.state / "reserve").stat().st_size == 2**16


def test_the_config_is_written_once(tmp_path):
    config, run = ended(tmp_path, status="interrupted", step=500)
    before = (run.path / "config.yaml").stat()
    with acquire(changed(config, keep_replay=True)) as (_, decision):
        assert decision.action is Next.RESUME
    after = (run.path / "config.yaml").stat()
    assert (before.st_mtime_ns, before.st_ino) == (after.st_mtime_ns, after.st_ino)


def test_the_config_on_disk_is_a_valid_configuration_again(tmp_path):
    from src.config.identity import Run
    from src.config.validation import validate

    _, run = ended(tmp_path)
    assert Run(validate(run.read_config())).configuration_hash == run.manifest.configuration_hash
    assert run.read_config()["results_dir"] == "results"


def test_a_resume_counts_keeps_what_was_and_notes_what_differs(tmp_path):
    config, run = ended(tmp_path, status="interrupted", step=500, wall_time_seconds=12.5, observation_size=11)
    started = run.manifest.started
    versions = {**run.manifest.versions, "torch": "1.0"}
    del versions["scipy"]  # of a time when it was not yet listed
    run.update_manifest(processor="Another 9000", versions=versions)
    with acquire(config) as (again, _):
        manifest = again.manifest
    assert (manifest.times_resumed, manifest.wall_time_seconds, manifest.observation_size) == (1, 12.5, 11)
    assert (manifest.started, manifest.step, manifest.status) == (started, 500, "running")
    assert any("Another 9000 ->" in note for note in manifest.notes)
    assert any("torch 1.0 ->" in note for note in manifest.notes)
    assert not any("scipy" in note for note in manifest.notes)
    assert manifest.versions["scipy"]
    assert "Another 9000" in (run.state / "log.txt").read_text()


def test_two_runs_in_one_directory_are_refused():
    runs = [run_of("protocol.update_after=1000"), run_of("protocol.update_after=2000")]
    with pytest.raises(ConfigurationError, match=r"differ in protocol\.update_after"):
        make_plan(runs)
    with pytest.raises(ConfigurationError, match="twice"):
        make_plan([run_of(), run_of()])


def hold(config, ready, release):
    with acquire(config):
        ready.set()
        release.wait(30)


def test_a_live_process_is_busy_and_a_killed_one_never_blocks(tmp_path):
    config = smoke(tmp_path)
    context = multiprocessing.get_context("fork")
    ready, release = context.Event(), context.Event()
    holder = context.Process(target=hold, args=(config, ready, release))
    holder.start()
    try:
        assert ready.wait(20)
        assert next_action(config).action is Next.BUSY
        with pytest.raises(BusyError, match="held by a live process"), acquire(config):
            pass  # never reached
    finally:
        holder.kill()
        holder.join()
    assert next_action(config).action is Next.RESUME
    with acquire(config) as (_, decision):
        assert decision.action is Next.RESUME


def test_a_look_at_the_lock_does_not_make_a_claim_fail(tmp_path, monkeypatch):
    """A plan beside a starting job holds the lock for an instant: the job must wait, not give up."""
    monkeypatch.setattr(ownership, "ACQUIRE_SECONDS", 60.0)  # on a busy machine an instant may be long
    config, run = ended(tmp_path, status="interrupted", step=500)
    context = multiprocessing.get_context("fork")

    def let_go(released):
        with ownership.lock_of(run.path):
            released.set()
            time.sleep(0.5)

    released = context.Event()
    other = context.Process(target=let_go, args=(released,))
    other.start()
    assert released.wait(20)
    with acquire(config) as (_, decision):
        assert decision.action is Next.RESUME
    other.join()


def elsewhere(run, monkeypatch):
    """As if the run had been claimed under another boot than ours."""
    (run.state / "owner").write_text("another boot")
    assert state.boot_token() != "another boot"


def test_a_fresh_sign_of_life_from_another_machine_is_busy(tmp_path, monkeypatch):
    config, run = ended(tmp_path, status="running", step=500)
    elsewhere(run, monkeypatch)
    assert next_action(config).action is Next.BUSY
    monkeypatch.setattr(state, "FRESH_SECONDS", 0.0)
    assert next_action(config).action is Next.RESUME


def test_a_requeued_job_waits_until_the_other_machine_is_silent(tmp_path, monkeypatch):
    _, run = ended(tmp_path, status="running", step=500)
    elsewhere(run, monkeypatch)
    slept = []

    def silent(seconds):
        slept.append(seconds)
        monkeypatch.setattr(state, "FRESH_SECONDS", 0.0)

    monkeypatch.setattr(ownership.time, "sleep", silent)
    assert ownership.wait_for_stale_heartbeat(run) and len(slept) == 1


def test_a_requeued_job_leaves_a_run_whose_sign_of_life_moves(tmp_path, monkeypatch):
    _, run = ended(tmp_path, status="running", step=500)
    elsewhere(run, monkeypatch)

    def beat(_):
        path = run.path / "manifest.json"
        content = json.loads(path.read_text())
        content["updated"] = "2999-01-01T00:00:00Z"
        path.write_text(json.dumps(content))

    monkeypatch.setattr(ownership.time, "sleep", beat)
    assert not ownership.wait_for_stale_heartbeat(run)


def test_a_broken_manifest_is_refused_not_overwritten(tmp_path):
    config, run = ended(tmp_path)
    (run.path / "manifest.json").write_text("{")
    with pytest.raises(ConfigurationError, match="can't be read"):
        make_plan([config])
    assert next_action(changed(config, on_conflict="replace")).action is Next.REPLACE


def test_the_owner_names_no_machine(tmp_path):
    import socket

    _, run = ended(tmp_path)
    token = (run.state / "owner").read_text()
    assert len(token) == 16 and socket.gethostname() not in token
