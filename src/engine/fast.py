"""What :func:`src.algorithms.build.build_learner` takes of the engine: whom it serves, and the fast algorithms."""

from src.engine import sac, td3
from src.engine.binding import refusal

TD3, SAC = td3.FastTD3, sac.FastSAC

__all__ = ["SAC", "TD3", "refusal"]
