"""The configuration schema: every key, its range, its meaning and where its default comes from.

The YAML files under ``conf/`` are what a user reads and edits; Hydra composes them; :mod:`src.config.validation` turns
the composed configuration into these frozen dataclasses or says in one sentence what is wrong.

A key that is added to this schema after runs have been trained takes a default here: the behaviour before it. Where it
changes numbers it stands in :data:`src.config.identity.ADDED_KEYS` too.

Sources: [P] the BPT-SAN paper; [PopSAN] Tang et al., CoRL 2020; [SU] OpenAI Spinning Up. Decisions against or beyond
the paper are listed in ``docs/deviations.md``.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

#: Raised by hand when a change of the code moves results; part of every configuration hash.
ENGINE = 3

_STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
Positive = Annotated[int, Field(ge=1)]
PositiveFloat = Annotated[float, Field(gt=0)]
NonNegativeFloat = Annotated[float, Field(ge=0)]
UnitInterval = Annotated[float, Field(ge=0, le=1)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.,=+\[\]-]*$", max_length=200)]
Coding = Literal["poisson", "deterministic", "analog", "none"]
LayerSizes = Annotated[tuple[Positive, ...], Field(min_length=1)]


class ConfigurationError(ValueError):
    """A configuration that cannot be run. Its message is one or more sentences for the user."""


@dataclass(frozen=True, config=_STRICT)
class DendriticConfig:
    """Inter-layer connections: nonlinear dendritic trees [P, eqs. of ``Inter``]."""

    branches: Positive  # d; 1 is the linear synapse
    output_topology: bool  # dendrites and lateral interaction on the output population too
    bias: Literal["neuron", "branch"]  # one bias a neuron, after the max, or one a branch, inside it
    init_fan_in: Literal["layer", "branch"]  # the fan-in n of the weight initialisation: all inputs, or a branch's


@dataclass(frozen=True, config=_STRICT)
class LateralConfig:
    """Intra-layer connections: lateral interaction [P, eq. of ``Intra``]."""

    radius: Annotated[int, Field(ge=0)]  # neighbours at index distance 1..radius; 0 is none
    include_self: bool
    weights: Literal["per_neuron", "shared"]
    init_scale: NonNegativeFloat


@dataclass(frozen=True, config=_STRICT)
class DNConfig:
    """Constants of second-order dynamic neurons: the k-means centre that MDC-SAN's paper learnt on Ant."""

    theta_v: float = -0.172
    theta_u: float = 0.529
    theta_r: float = 0.021
    theta_s: float = 0.132


@dataclass(frozen=True, config=_STRICT)
class SpikingActorConfig:
    """One class serves all spiking actors: coding, neuron, synapse, lateral terms and readout are choices."""

    kind: Literal["spiking"]
    name: Name
    hidden_sizes: LayerSizes
    time_steps: Positive  # T
    current_decay: UnitInterval  # d_c
    voltage_decay: UnitInterval  # d_v
    threshold: PositiveFloat  # v_th
    surrogate_window: PositiveFloat  # w
    reset_gradient: bool  # the hard reset's factor (1 - o) carries gradient
    lateral_gradient: bool  # the lateral term carries gradient
    output_population: Positive  # neurons per action dimension
    dendritic: DendriticConfig
    lateral: LateralConfig
    mask_seed: Annotated[int, Field(ge=0)] | None  # None: derived from the run's seed
    learning_rate: PositiveFloat
    log_std_network: Literal["separate", "shared"]
    spikes: Literal[True] = True
    coding: Literal["encoder", "analog"] = "encoder"  # the encoder's spikes, or always the stimulation strength itself
    neuron: Literal["clif", "dn"] = "clif"  # current-based LIF (current_decay 0: plain LIF) or dynamic neuron
    dn: DNConfig = DNConfig()
    output_lateral: Literal["none", "all", "no_self", "self_only"] = "none"  # within an action's output neurons
    output_lateral_bias: bool = True
    readout: Literal["rate", "last_membrane", "mean_membrane", "max_membrane"] = "rate"
    readout_decay: UnitInterval = 1.0  # lambda of the membrane readout


@dataclass(frozen=True, config=_STRICT)
class PopulationMLPActorConfig:
    """Pop-DAN: PopSAN's encoder and decoder around a multilayer perceptron."""

    kind: Literal["population_mlp"]
    name: Name
    hidden_sizes: LayerSizes
    output_population: Positive  # ReLU units per action dimension
    learning_rate: PositiveFloat
    coding: Literal["analog"]
    log_std_network: Literal["separate"] = "separate"
    spikes: Literal[False] = False


@dataclass(frozen=True, config=_STRICT)
class MLPActorConfig:
    """The artificial actor network (AAN)."""

    kind: Literal["mlp"]
    name: Name
    hidden_sizes: LayerSizes
    learning_rate: PositiveFloat
    log_std_network: Literal["separate", "shared"]
    spikes: Literal[False] = False


@dataclass(frozen=True, config=_STRICT)
class CustomActorConfig:
    """An actor of the user's own: one Python file plus one YAML file (see CONTRIBUTING.md)."""

    kind: Literal["custom"]
    name: Name
    target: Annotated[str, Field(pattern=r"^\w+(\.\w+)+$")]  # dotted path of the class
    arguments: dict[str, Any]
    spikes: bool  # whether it takes spike trains from an encoder
    learning_rate: PositiveFloat
    log_std_network: Literal["separate"] = "separate"


ActorConfig = Annotated[
    SpikingActorConfig | MLPActorConfig | PopulationMLPActorConfig | CustomActorConfig, Field(discriminator="kind")
]


@dataclass(frozen=True, config=_STRICT)
class EncoderConfig:
    """Population encoder and spike coding [P, Input Encoding]."""

    name: Literal["task", "poisson", "deterministic", "analog"]
    coding: Coding
    population_size: Positive  # J
    mean_range: Annotated[tuple[float, float], Field(strict=False)]  # mu = linspace(low, high, J)
    std: PositiveFloat  # initial sigma
    min_std: PositiveFloat  # sigma is projected to at least this after each optimizer step
    learnable: bool
    threshold: PositiveFloat  # of the deterministic coding
    input_map: Literal["none", "tanh"] = "none"  # what the receptive fields see of an observation


@dataclass(frozen=True, config=_STRICT)
class EnvConfig:
    """A Gymnasium task."""

    name: Name
    id: str
    kwargs: dict[str, Any]
    zero_padding: Annotated[int, Field(ge=0)]  # constant zeros appended to the observation
    max_episode_steps: Positive
    spike_coding: Literal["poisson", "deterministic"]  # what the paper used for the task [P, Implement Details]


@dataclass(frozen=True, config=_STRICT)
class TD3Config:
    """TD3 with Spinning Up's hyper-parameters [SU]."""

    name: Literal["td3"]
    discount: UnitInterval
    polyak: UnitInterval
    batch_size: Positive
    replay_capacity: Positive
    critic_hidden_sizes: LayerSizes
    critic_learning_rate: PositiveFloat
    actor_learning_rate: PositiveFloat
    exploration_noise: NonNegativeFloat
    target_noise: NonNegativeFloat
    target_noise_clip: NonNegativeFloat
    policy_delay: Positive


@dataclass(frozen=True, config=_STRICT)
class TD3ProxyConfig(TD3Config):
    """TD3 with a proxy target (Xu et al., NeurIPS 2025)."""

    name: Literal["td3_proxy"]  # type: ignore[assignment]
    proxy_hidden_sizes: LayerSizes
    proxy_steps: Positive  # K: minibatches that the proxy imitates the actor on before each critic update
    proxy_learning_rate: PositiveFloat


@dataclass(frozen=True, config=_STRICT)
class SACConfig:
    """SAC with a fixed temperature and Spinning Up's hyper-parameters [SU]."""

    name: Literal["sac"]
    discount: UnitInterval
    polyak: UnitInterval
    batch_size: Positive
    replay_capacity: Positive
    critic_hidden_sizes: LayerSizes
    critic_learning_rate: PositiveFloat
    actor_learning_rate: PositiveFloat
    alpha: NonNegativeFloat
    log_std_network: Literal["separate", "shared"]
    log_std_hidden_sizes: LayerSizes
    log_std_learning_rate: PositiveFloat
    log_std_min: float
    log_std_max: float


AlgoConfig = Annotated[TD3Config | TD3ProxyConfig | SACConfig, Field(discriminator="name")]


@dataclass(frozen=True, config=_STRICT)
class ProtocolConfig:
    """How long to train and when to evaluate [P, Evaluation; SU for the schedule]."""

    name: Name
    total_steps: Positive
    start_steps: Annotated[int, Field(ge=0)]  # uniform random actions until then
    update_after: Annotated[int, Field(ge=0)]  # the first updates once more than this many steps are stored
    update_every: Positive  # environment steps per collector batch = gradient updates per burst
    evaluation_interval: Positive
    evaluation_episodes: Positive
    checkpoint_interval: Positive


@dataclass(frozen=True, config=_STRICT)
class LoggerConfig:
    """Where live curves go besides ``training.csv``; never changes a number."""

    name: Literal["tensorboard", "wandb", "none"]
    project: str
    mode: Literal["offline", "online"]


@dataclass(frozen=True, config=_STRICT)
class ExperimentConfig:
    """One run of the grid: actor x encoder x environment x algorithm x seed."""

    algo: AlgoConfig
    actor: ActorConfig
    encoder: EncoderConfig
    env: EnvConfig
    protocol: ProtocolConfig
    logger: LoggerConfig
    normalize_observations: bool
    normalization_clip: PositiveFloat
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    threads: Positive
    device: Annotated[str, Field(pattern=r"^(cpu|cuda(:\d+)?)$")]
    study: Name
    label: Name | None
    results_dir: str
    on_conflict: Literal["refuse", "replace"]
    keep_replay: bool
    dry_run: bool
    sweeps: None = None
    keep_best: bool = True  # besides the final policy that of the best evaluation
    blas: Literal["auto", "mkl", "openblas"] = "auto"  # the library of the matrix products (src/engine/blas.py)
    backend: Literal["auto", "fast", "plain"] = "auto"  # updates by src/engine or plain; auto: fast where it can
