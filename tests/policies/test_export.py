"""If these fail, a policy that was carried away does something else there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from src import export
from src.actors.spike_coding import poisson_draws
from src.config.schema import ConfigurationError
from src.policies.export_nir import refuse
from src.policies.export_onnx import PlainPolicy
from src.policies.trace import trace
from src.streams import Streams
from src.training.evaluation import Evaluator
from src.training.policy_file import TrainedPolicy, load_policy
from tests.helpers import tiny
from tests.training.test_session import run

CASES = [
    ("bptsan", "hopper"),
    ("bptsan", "halfcheetah"),
    ("popsan", "hopper"),
    ("aan", "halfcheetah"),
    ("popdan", "hopper"),
    ("mdcsan", "halfcheetah"),
    ("ilcsan", "hopper"),
]


@pytest.fixture(scope="module", params=CASES, ids=lambda case: "-".join(case))
def policy(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    actor, env = request.param
    return run(tiny(tmp_path_factory.mktemp("export"), actor=actor, env=env))[1]


def observations(trained: TrainedPolicy, count: int) -> torch.Tensor:
    """Those of episodes that the policy plays."""
    seen: list[torch.Tensor] = []

    def act(observation: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
        seen.append(observation)
        return trained.act(observation, generator)

    step = 0
    while sum(map(len, seen)) < count:
        Evaluator(trained.config.env, 2, Streams(7)).evaluate(act, step)
        step += 1
    return torch.cat(seen)[:count]


def test_onnx_acts_as_the_policy_on_a_thousand_real_observations(policy: Path, tmp_path: Path) -> None:
    pytest.importorskip("onnx")
    runtime = pytest.importorskip("onnxruntime")
    path = tmp_path / "policy.onnx"
    assert export.main([str(policy), "--to", "onnx", "--output", str(path)]) == 0
    trained = load_policy(policy / "policy.pt")
    plain = PlainPolicy(trained)
    batch = observations(trained, 1000)
    expected = trained.act(batch, torch.Generator().manual_seed(3)).numpy()
    inputs = {"observation": batch.numpy()}
    if plain.draws:
        encoder = trained.policy.actor.encoder
        strength = encoder.strength(trained.normalizer.normalize(batch)).detach()
        uniform = poisson_draws(strength, encoder.time_steps, torch.Generator().manual_seed(3))
        inputs["uniform"] = uniform.numpy()
    session = runtime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    assert [each.name for each in session.get_inputs()] == list(inputs)
    (found,) = session.run(None, inputs)
    np.testing.assert_allclose(found, expected, atol=1e-5, rtol=0)
    one = {name: value[:1] if name == "observation" else value[:, :1] for name, value in inputs.items()}
    np.testing.assert_allclose(session.run(None, one)[0], expected[:1], atol=1e-5, rtol=0)


def test_without_the_package_one_sentence_says_which(
    tiny_run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "onnx", None)
    assert export.main([str(tiny_run), "--to", "onnx"]) == 2
    assert "the package onnx is missing: pip install '.[export]'" in capsys.readouterr().err


def test_nir_read_back_by_another_simulator_fires_as_the_policy(tmp_path: Path) -> None:
    nir = pytest.importorskip("nir")
    pytest.importorskip("nirtorch")
    import_nir = pytest.importorskip("snntorch.import_nir")
    trained_in = run(tiny(tmp_path, actor="popsan", env="halfcheetah"))[1]
    path = tmp_path / "policy.nir"
    assert export.main([str(trained_in), "--to", "nir", "--output", str(path)]) == 0
    trained = load_policy(trained_in / "policy.pt")
    batch = trained.normalizer.normalize(observations(trained, 200))
    seen = trace(trained.policy.actor, batch)
    network = import_nir.import_from_nir(nir.read(str(path)))
    state, outputs = None, []
    with torch.no_grad():
        for spikes in seen.connections[0].inputs:
            output, state = network(spikes, state)
            outputs.append(output)
    assert seen.neurons[-1].activations.mean() > 0.01, "a silent network would agree with anything"
    torch.testing.assert_close(torch.stack(outputs).mean(0), seen.raw, atol=1e-5, rtol=0)


@pytest.mark.parametrize("actor,part", [("bptsan", "dendritic maxout"), ("bptsan_wo_ndt", "lateral"), ("aan", "onnx")])
def test_what_nir_has_no_word_for_is_refused_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], actor: str, part: str
) -> None:
    pytest.importorskip("nir")
    trained_in = run(tiny(tmp_path, actor=actor))[1]
    assert export.main([str(trained_in), "--to", "nir"]) == 2
    assert part in capsys.readouterr().err and not (trained_in / "policy.nir").exists()


@pytest.mark.parametrize("actor", ["popdan", "mdcsan", "ilcsan"])
def test_the_actors_of_other_papers_are_carried_or_refused(actor: str, tmp_path: Path) -> None:
    trained = load_policy(run(tiny(tmp_path, actor=actor, env="halfcheetah"))[1] / "policy.pt")
    batch = torch.randn(20, trained.normalizer.size)
    expected = trained.act(batch, torch.Generator())
    torch.testing.assert_close(PlainPolicy(trained)(batch), expected, rtol=0, atol=1e-6)
    with pytest.raises(ConfigurationError, match=f"{actor}: .*use --to onnx"):
        refuse(trained)
