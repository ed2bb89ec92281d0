"""The spiking network of a trained policy in NIR, the Neuromorphic Intermediate Representation.

    input spikes -> (Affine -> CubaLIF) x layers -> Affine, the decoder; the raw action is its mean over the T steps

NIR's current-based neuron, ``tau_syn dI/dt = -I + w_in S`` and ``tau_mem dv/dt = -v + R I``, is ours in steps of dt:

    tau_syn = dt / (1 - d_c), w_in = tau_syn / dt        tau_mem = dt / (1 - d_v), R = tau_mem / dt

current first, then the potential, then the spike, and v = 0 after it. NIR has no population encoder and no squashing:
the input is what our encoder gives, ``[T, N*J]``, and the action ``limit * tanh(raw)``.

Source: Pedersen et al., "Neuromorphic intermediate representation", Nature Communications 15, 8122 (2024).
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch

from src.actors.decoder import MembraneReadout
from src.actors.lif import LIFConstants
from src.actors.spiking_actor import SpikingActor
from src.config.schema import ConfigurationError
from src.policies.trace import computes_as
from src.training.policy_file import TrainedPolicy

#: Seconds of a time step: NIR counts in seconds, and simulators (snnTorch, Norse) read it in steps of this length.
DT = 1e-4


def export_nir(trained: TrainedPolicy, path: Path) -> str:
    """Write the graph; returns what it takes and gives.

    Raises:
        ConfigurationError: the package nir is missing, or NIR has no word for a part of the actor, which is named.
    """
    try:
        import nir
    except ImportError:
        raise ConfigurationError("the package nir is missing: pip install '.[export]'.") from None
    actor = trained.policy.actor
    refuse(trained)
    assert isinstance(actor, SpikingActor)
    nodes: dict[str, Any] = {"input": nir.Input(input_type={"input": np.array([actor.encoder.size])})}
    for number, layer in enumerate(actor.spiking_layers(), start=1):
        nodes[f"layer{number}_weights"] = nir.Affine(_array(layer.synapse.weight), _array(layer.synapse.bias))
        assert isinstance(layer.constants, LIFConstants)
        nodes[f"layer{number}"] = nir.CubaLIF(**_neurons(layer.constants, len(layer.synapse.bias)))
    nodes["decoder"] = nir.Affine(_array(_decoder(actor)), _array(actor.decoder.bias))
    actions = len(actor.decoder.bias)
    nodes["output"] = nir.Output(output_type={"output": np.array([actions])})
    names = list(nodes)
    nir.write(str(path), nir.NIRGraph(nodes=nodes, edges=list(pairwise(names))))
    steps = actor.encoder.time_steps
    return (
        f"spikes of the encoder [{steps}, {actor.encoder.size}] -> {actions} numbers at each of {steps} steps of "
        f"{DT:g} s, whose mean is the raw action"
    )


def refuse(trained: TrainedPolicy) -> None:
    """Raise ConfigurationError where NIR has no word for a part of the actor, or the input is no spikes."""
    actor = trained.policy.actor
    name = trained.config.actor.name
    if not computes_as(actor, SpikingActor):
        raise ConfigurationError(
            f"{name}: is no population-coded spiking network, which --to nir takes; use --to onnx."
        )
    assert isinstance(actor, SpikingActor)
    if actor.encoder.coding == "analog":
        raise ConfigurationError(f"{name}: --to nir takes spikes of an encoder, not analog input; use --to onnx.")
    if isinstance(actor.decoder, MembraneReadout):
        raise ConfigurationError(f"{name}: --to nir has the readout by firing rates only; use --to onnx.")
    for number, layer in enumerate(actor.spiking_layers(), start=1):
        if layer.synapse.branches > 1:
            raise ConfigurationError(f"{name}: NIR has no dendritic maxout (layer {number}); use --to onnx.")
        if not isinstance(layer.constants, LIFConstants):
            raise ConfigurationError(f"{name}: NIR has no dynamic neurons (layer {number}); use --to onnx.")
        if layer.lateral is not None or layer.output_lateral is not None:
            raise ConfigurationError(f"{name}: NIR has no lateral interaction of ours (layer {number}); use --to onnx.")
        if max(layer.constants.current_decay, layer.constants.voltage_decay) >= 1:
            raise ConfigurationError(f"{name}: NIR has no neuron without leak and with current (layer {number}).")


def _neurons(constants: LIFConstants, neurons: int) -> dict[str, np.ndarray]:
    tau_syn, tau_mem = DT / (1 - constants.current_decay), DT / (1 - constants.voltage_decay)
    values = {
        "tau_syn": tau_syn,
        "tau_mem": tau_mem,
        "r": tau_mem / DT,
        "v_leak": 0.0,
        "v_threshold": constants.threshold,
        "w_in": tau_syn / DT,
        "v_reset": 0.0,
    }
    return {name: np.full(neurons, value) for name, value in values.items()}


def _decoder(actor: SpikingActor) -> torch.Tensor:
    """The grouped map as a matrix, ``[M, M*P]``."""
    return torch.block_diag(*actor.decoder.weight.detach().unbind(0))


def _array(tensor: torch.Tensor) -> np.ndarray:
    return tensor.detach().numpy().copy()
