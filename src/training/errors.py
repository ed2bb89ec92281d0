"""Errors of training that a user meets, each with a message that says what to do next."""

from __future__ import annotations


class CorruptState(RuntimeError):
    """Saved state (a checkpoint, the replay) that is missing, cut short or does not fit the run."""
