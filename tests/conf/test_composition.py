"""Every option and every combination that a user can type."""

import itertools
import re
from functools import cache
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from src.config.schema import ConfigurationError
from src.config.validation import validate
from tests.experiment.runs import ROOT, composed, run_of

CONF = ROOT / "conf"
OPTIONS = {
    group: {path.stem: composed(f"{group}={path.stem}")[group] for path in sorted((CONF / group).glob("*.yaml"))}
    for group in ("algo", "actor", "encoder", "env", "protocol", "logger")
}
RIVALS = {"popdan", "mdcsan", "ilcsan", "lif_san"}
OTHER_TASKS = {"hopper_v5", "walker2d_v5", "halfcheetah_v5", "ant_v5", "inverted_double_pendulum", "humanoid"}
NAMES = {
    "algo": {"td3", "sac", "td3_proxy"},
    "actor": {
        "aan",
        "popsan",
        "bptsan",
        "bptsan_wo_ndt",
        "bptsan_wo_li",
        "popdan",
        "mdcsan",
        "ilcsan",
        "lif_san",
    },
    "encoder": {"task", "poisson", "deterministic", "analog"},
    "env": {"hopper", "walker2d", "halfcheetah", "ant", "ant_zero_contact", "ant_no_contact", *OTHER_TASKS},
    "protocol": {"paper", "short", "demo", "smoke"},
    "logger": {"tensorboard", "wandb", "none"},
}


DEFAULTS = {"algo": "td3", "actor": "bptsan", "encoder": "task", "env": "hopper", "protocol": "paper"}


@cache
def resolved(*choices):
    """Some groups, put together and resolved: an option refers to no other group than those."""
    return OmegaConf.to_container(OmegaConf.create({g: OPTIONS[g][name] for g, name in choices}), resolve=True)


def put_together(**choices):
    """What Hydra composes, without Hydra's quarter of a second."""
    chosen = {**DEFAULTS, "logger": "tensorboard", **choices}
    whole = dict(OmegaConf.to_container(composed("study=x")))
    for groups in (("actor", "algo"), ("env", "encoder"), ("protocol",), ("logger",)):
        whole |= resolved(*((group, chosen[group]) for group in groups))
    return whole | {"study": chosen["protocol"]}


def test_the_options_are_those_promised_and_named_as_their_files():
    for group, names in NAMES.items():
        assert names <= set(OPTIONS[group])
        for name, option in OPTIONS[group].items():
            assert option.name == name


@pytest.mark.parametrize(
    "choices",
    [
        {"algo": "sac", "actor": "aan", "env": "ant"},
        {"actor": "popsan", "encoder": "deterministic", "protocol": "smoke", "logger": "none"},
    ],
)
def test_putting_together_is_what_hydra_does(choices):
    by_hydra = composed(*(f"{group}={choice}" for group, choice in choices.items()))
    assert put_together(**choices) == OmegaConf.to_container(by_hydra, resolve=True)


def test_every_valid_combination_composes_and_every_invalid_one_is_refused():
    valid = refused = 0
    groups = ("algo", "actor", "encoder", "env", "protocol")
    for names in itertools.product(*(sorted(OPTIONS[group]) for group in groups)):
        choices = dict(zip(groups, names))
        content = put_together(**choices)
        own = {"aan": "none", "aan_matched": "none", "popdan": "analog", "mdcsan": "analog"}.get(choices["actor"])
        if own and choices["encoder"] not in ("task", own):
            with pytest.raises(
                ConfigurationError, match=f"encoder={choices['encoder']}: actor {choices['actor']} takes"
            ):
                validate(content)
            refused += 1
            continue
        config = validate(content)
        coding = {"task": config.env.spike_coding}.get(config.encoder.name, config.encoder.name)
        assert config.encoder.coding == (own or coding)
        valid += 1
    assert valid >= 2 * (4 * 3 + 1) * 6 * 4
    assert refused >= 2 * 2 * 6 * 4


@pytest.mark.parametrize("logger", sorted(OPTIONS["logger"]))
def test_every_logger_composes(logger):
    assert validate(put_together(logger=logger)).logger.name == logger


@pytest.mark.parametrize(
    ("env", "coding"),
    [("hopper", "poisson"), ("walker2d", "poisson"), ("halfcheetah", "deterministic"), ("ant", "deterministic")],
)
def test_encoder_task_is_the_papers_coding_and_the_command_line_wins(env, coding):
    assert run_of(f"env={env}").config.encoder.coding == coding
    assert run_of(f"env={env}", "encoder=poisson").config.encoder.coding == "poisson"


YAML_FILES = sorted({*CONF.glob("**/*.yaml"), *(ROOT / "sweeps").glob("*.yaml")})


@pytest.mark.parametrize("path", YAML_FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_key_has_a_comment(path):
    """On its own line, or the file's first line for the keys that only say what the file is."""
    lines = path.read_text().splitlines()
    assert any(line.startswith("# ") and "@package" not in line for line in lines[:2])
    exempt = {"name", "kind", "_target_", "hydra", "sweeper", "defaults"}
    block_indent = None
    for line in lines:
        indent = len(line) - len(line.lstrip())
        if block_indent is not None and (not line.strip() or indent > block_indent):
            continue  # text of a block scalar
        block_indent = indent if re.search(r":\s*\|", line) else None
        key = re.match(r"\s*(?:- )?(?:override )?([\w/]+):", line)
        if key and key.group(1) not in exempt:
            assert "# " in line, f"{path.name}: {line.strip()} has no comment"


PAPERS = {"aan", "popsan", "bptsan", "bptsan_wo_ndt", "bptsan_wo_li"}
SWEEPS = {
    "main_td3": ("td3", {"aan", "popsan", "bptsan"}, 4, 10, "paper", "paper"),
    "main_sac": ("sac", {"aan", "popsan", "bptsan"}, 4, 10, "paper", "paper"),
    "ablation_td3": ("td3", {"bptsan", "bptsan_wo_ndt", "bptsan_wo_li"}, 4, 10, "paper", "paper"),
    "ablation_sac": ("sac", {"bptsan", "bptsan_wo_ndt", "bptsan_wo_li"}, 4, 10, "paper", "paper"),
    "demo": (None, {"aan", "popsan", "bptsan"}, 2, 2, "demo", None),
    "hopper_td3": ("td3", PAPERS, 1, 3, "short", "hopper_td3"),
    "td3_100k": ("td3", PAPERS, 2, 5, "short", "td3_100k"),
    "rivals_td3": ("td3", PAPERS | RIVALS, 2, 5, "short", "rivals_100k"),
    "controls_td3": ("td3", {"aan", "aan_matched", "popdan", "popsan", "bptsan"}, 1, 5, "short", "controls_td3"),
    "proxy_target": (
        "td3,td3_proxy",
        {"aan", "popsan", "mdcsan", "ilcsan", "lif_san"},
        4,
        5,
        "proxy_target",
        "proxy_target",
    ),
    "sac_100k": ("sac", {"aan", "popsan", "bptsan"}, 2, 3, "short", "sac_100k"),
}


def test_sweep_files_hold_the_grids_that_they_promise():
    assert {path.stem for path in (ROOT / "sweeps").glob("*.yaml")} >= set(SWEEPS)
    for name, (algo, actors, envs, seeds, protocol, study) in SWEEPS.items():
        content = OmegaConf.load(ROOT / "sweeps" / f"{name}.yaml").hydra
        assert content.mode == "MULTIRUN"
        params = content.sweeper.params
        assert params.get("algo") == algo
        assert set(params.actor.split(",")) == actors
        assert set(params.env.split(",")) <= NAMES["env"] and len(params.env.split(",")) == envs
        assert params.seed == f"range({seeds})"
        assert (params.protocol, params.get("study")) == (protocol, study)
        if protocol == "short":
            assert next(iter(params)) == "seed", "seed by seed: a stopped sweep has whole comparisons"
    assert Path(CONF / "sweeps").resolve() == ROOT / "sweeps"
