"""Bad input gets one clear sentence and exit code 2: no traceback, nothing started."""

import os
import sys

import pytest
from hydra.core.plugins import Plugins
from hydra.core.singleton import Singleton

from src import run as command
from tests.experiment.runs import ROOT


@pytest.fixture
def typed(monkeypatch, capsys, tmp_path):
    """What ``python -m src.run ARGUMENTS`` would do, in this process."""
    for name in ("PYTHONPATH", "HYDRA_FULL_ERROR"):  # put back afterwards
        monkeypatch.setenv(name, os.environ.get(name, ""))
    monkeypatch.setattr(sys, "path", sys.path.copy())
    monkeypatch.chdir(ROOT)
    monkeypatch.delitem(Singleton._instances, Plugins, raising=False)  # it looks for plugins once per process

    def run(*arguments, results=tmp_path / "results"):
        monkeypatch.setattr(sys, "argv", ["run", *arguments, *([f"results_dir={results}"] if results else [])])
        try:
            code = command.main()
        except SystemExit as stop:
            code = stop.code
        out, err = capsys.readouterr()
        return code, out, err

    return run


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ["actor=pposan"],
            "actor=pposan: there is no such option (did you mean popsan?); there are aan, aan_matched, bptsan,",
        ),
        (["actor.TT=3"], "actor.TT: there is no such key"),
        (["TT=3"], "TT: there is no such key"),
        (["actor=aan", "actor.time_steps=3"], "actor.time_steps: there is no such key"),
        (["seed=abc"], "seed: should be a whole number, found 'abc'"),
        (["seed=-1"], "seed: should be at least 0, found -1"),
        (["seed=1e6"], "seed: should be a whole number, found 1000000.0"),
        (["protocol.total_steps=5000"], "protocol.total_steps: 5000 is smaller than protocol.start_steps (10000)"),
        (["protocol.total_steps=100025"], "protocol.total_steps: 100025 is not a multiple of protocol.update_every"),
        (["protocol.evaluation_interval=30000"], "must be multiples of one another"),
        (["actor.dendritic.branches=257"], "actor.dendritic.branches: 257 exceeds the 256 inputs"),
        (["actor.lateral.radius=256"], "actor.lateral.radius: 256 should be smaller than the layer width (256)"),
        (["actor=aan", "encoder=poisson"], "encoder=poisson: actor aan takes no spikes"),
        (["env.id=Foo-v1"], "env.id: Gymnasium has no task Foo-v1"),
        (["env.id=Hopper-v99"], "env.id: Gymnasium has no task Hopper-v99"),
        (["env.id=Hopper-v3"], "env.id: Gymnasium has no task Hopper-v3: The mujoco v2 and v3"),
        (["study=1"], "study: should be text (it takes quotes: study=\"'1'\"), found 1."),
        (["study=[a]"], "study: should be text, found ['a']."),
        (["actor.hidden_sizes={a:1}"], "a list can't take the place of a mapping of keys"),
        (["~actor"], "actor.learning_rate: a value is taken from this key, and it is missing."),
        (["+foo=1"], "foo: there is no such key"),
        (["+actor.foo=1"], "actor.foo: there is no such key"),
        (["++actor.dendritic.foo=1"], "actor.dendritic.foo: there is no such key"),
        (["env.kwargs.foo=1"], "write +env.kwargs.foo=... to add it"),
        (["env.kwargs={foo:1}"], "write +env.kwargs.NAME=... to add one"),
        (["~seed"], "seed: this key is missing"),
        (["study=" + "x" * 201], "study: should be at most 200 characters, found"),
        (["label=a|é"], "label=a|é: this can't be read; quote a value with special characters"),
        (["seed=range(a)"], "seed=range(a): this can't be read ('range(a)': mismatch type argument start"),
        (["foo"], "foo: should be key=value"),
        (["actor=[a"], "actor=[a: this can't be read; quote"),
        (["actor=3"], "A group takes the name of an option"),
        (["label=${nope}"], "nope: a value is taken from this key, and it is missing."),
        (["seed=range(3)"], "seed=range(3): several values make a grid; add -m"),
        (["actor=aan,popsan"], "actor=aan,popsan: several values make a grid; add -m"),
        (["-m", "seed=range(3),7"], "seed=range(3),7: a range can't be mixed with other values"),
        (["-m", "seed=interval(0,3)"], "seed=interval(0,3): a grid needs single values"),
        (["-m", "seed=[0,1]"], "seed: should be a whole number, found [0, 1]"),
        (["-m", "actor=aan,nope"], "actor=nope: there is no such option"),
        (["-m", "seed=0,-1"], "seed: should be at least 0, found -1. (in the run seed=-1"),
        (["-m", "seed=1,1"], "seed_1: the grid has this run twice"),
        (["-m", "protocol.update_after=1000,2000"], "they differ in protocol.update_after"),
        (["sweeps=main_td3,main_sac"], "one sweep file per command"),
        (["-m", "sweeps=main_td3,main_sac"], "one sweep file per command"),
        (["-m", "sweeps=glob(main*)"], "one sweep file per command"),
        (["sweeps=demo", "sweeps=main_td3"], "one sweep file per command"),
        (["+sweeps=demo"], "write it without the plus"),
        (["sweeps=nope"], "sweeps=nope: there is no such option"),
        (["hydra/launcher=nope"], "hydra/launcher=nope: there is no such option"),
        (["seed=0,1", "-m", "hydra.launcher.n_jobs=0"], "hydra.launcher.n_jobs: should be at least 1, found 0"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_one_clear_sentence(typed, tmp_path, arguments, said):
    code, out, err = typed(*arguments)
    assert said in err
    assert code == 2
    assert "Traceback" not in out + err and "Error executing" not in err and "HYDRA_FULL_ERROR" not in err
    assert len(err.strip().splitlines()) <= 3
    assert not (tmp_path / "results").exists(), "nothing may be started"


def test_a_mistake_in_a_list_is_one_sentence(typed):
    code, _, err = typed("actor.hidden_sizes=[a]")
    assert code == 2 and err == "actor.hidden_sizes.0: should be a whole number, found 'a'.\n"


@pytest.mark.parametrize("arguments", [["protocol=smoke"], ["-m", "protocol=smoke", "seed=0,1"]])
def test_a_results_folder_that_cannot_be_written(typed, tmp_path, arguments):
    (tmp_path / "file").write_text("")
    code, _, err = typed(*arguments, results=tmp_path / "file" / "results")
    assert code == 2 and "can't be written (Not a directory)" in err and "Traceback" not in err


def test_a_developer_can_ask_for_the_traceback(typed, monkeypatch):
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    with pytest.raises(Exception, match="pposan"):
        typed("actor=pposan")


def test_help_shows_the_command_the_groups_and_the_keys(typed):
    code, out, _ = typed("--help", results=None)
    assert code in (0, None)
    for part in (
        "python -m src.run -m actor=bptsan,popsan,aan",
        "actor: aan, aan_matched, bptsan",
        "sweeps: ablation_sac",
        "seed: 0",
    ):
        assert part in out


def test_the_composed_configuration_can_be_printed(typed):
    code, out, _ = typed("--cfg", "job", results=None)
    assert code == 0 and "actor:" in out


def test_dry_run_starts_nothing_and_tells_hours_and_disk(typed, tmp_path):
    for arguments in (["dry_run=true"], ["-m", "seed=range(2)", "actor=aan,bptsan", "dry_run=true"]):
        code, out, _ = typed(*arguments)
        assert code == 0 and "core-hours" in out and "of disk" in out
        assert not (tmp_path / "results").exists()
