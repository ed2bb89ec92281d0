"""The configuration: its schema, the rules between keys, and one sentence for each mistake. Never imports torch."""

from src.config.schema import (
    ENGINE,
    ActorConfig,
    AlgoConfig,
    CustomActorConfig,
    DendriticConfig,
    EncoderConfig,
    EnvConfig,
    ExperimentConfig,
    LateralConfig,
    LoggerConfig,
    MLPActorConfig,
    ProtocolConfig,
    SACConfig,
    SpikingActorConfig,
    TD3Config,
)
from src.config.validation import ConfigurationError, to_dict, validate

__all__ = [
    "ENGINE",
    "ActorConfig",
    "AlgoConfig",
    "ConfigurationError",
    "CustomActorConfig",
    "DendriticConfig",
    "EncoderConfig",
    "EnvConfig",
    "ExperimentConfig",
    "LateralConfig",
    "LoggerConfig",
    "MLPActorConfig",
    "ProtocolConfig",
    "SACConfig",
    "SpikingActorConfig",
    "TD3Config",
    "to_dict",
    "validate",
]
