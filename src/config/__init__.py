"""From what a user types to a run with a name, one sentence for each mistake. Never imports torch.

The schema and the rules between its keys are imported from here; ``command_line`` and ``compose`` are Hydra's side,
``identity`` has hashes, labels and paths.
"""

from src.config.schema import (
    ENGINE,
    ActorConfig,
    AlgoConfig,
    CustomActorConfig,
    DendriticConfig,
    DNConfig,
    EncoderConfig,
    EnvConfig,
    ExperimentConfig,
    LateralConfig,
    LoggerConfig,
    MLPActorConfig,
    PopulationMLPActorConfig,
    ProtocolConfig,
    SACConfig,
    SpikingActorConfig,
    TD3Config,
    TD3ProxyConfig,
)
from src.config.validation import ConfigurationError, to_dict, validate

__all__ = [
    "ENGINE",
    "ActorConfig",
    "AlgoConfig",
    "ConfigurationError",
    "CustomActorConfig",
    "DNConfig",
    "DendriticConfig",
    "EncoderConfig",
    "EnvConfig",
    "ExperimentConfig",
    "LateralConfig",
    "LoggerConfig",
    "MLPActorConfig",
    "PopulationMLPActorConfig",
    "ProtocolConfig",
    "SACConfig",
    "SpikingActorConfig",
    "TD3Config",
    "TD3ProxyConfig",
    "to_dict",
    "validate",
]
