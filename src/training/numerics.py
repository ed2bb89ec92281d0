"""How this process computes: the same way wherever a policy is trained, evaluated or timed."""

from __future__ import annotations

import ctypes

import torch

from src.config.schema import ConfigurationError, ExperimentConfig
from src.engine import blas
from src.experiment.progress import Progress
from src.experiment.run_directory import RunDirectory

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # of glibc's malloc.h
_LARGEST = 32 << 20  # threshold that older versions of glibc accept


def set_numerics(threads: int) -> None:
    """Set the number of CPU threads, flush denormal numbers to zero and keep freed memory.

    Adam's moments of a silent neuron decay through the denormal numbers (below 1.2e-38), on which a CPU is up to a
    hundred times slower; they change no action. A spiking layer's arrays are about a megabyte: glibc would give them
    back to the system after each use and fault every page in again.
    """
    torch.set_num_threads(threads)
    torch.set_flush_denormal(True)
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)  # glibc has it
    if mallopt is not None and mallopt(_MMAP_THRESHOLD, _LARGEST):
        mallopt(_TRIM_THRESHOLD, 1 << 30)


def select_blas(config: ExperimentConfig, run: RunDirectory) -> None:
    """Choose the library of the matrix products; before the learner is built, whose kernels are bound to it.

    Raises:
        ConfigurationError: the library that the configuration asks for is not here.
    """
    try:
        blas.select(config.blas, run.manifest.blas.get("library"))
    except blas.BLASUnavailableError as error:
        raise ConfigurationError(str(error)) from None


def record_blas(run: RunDirectory, progress: Progress, backend: str) -> None:
    """Record the library, and note where a resume finds another one; on the plain backend products are PyTorch's."""
    library = blas.Library("torch", torch.__version__, None) if backend == "plain" else blas.library()
    recorded = run.manifest.blas
    found = {"library": library.name, "version": library.version, "architecture": library.architecture}
    notes = list(run.manifest.notes)
    if recorded and recorded != found:
        names = [name for name in found if recorded.get(name) != found[name]]
        changes = ", ".join(f"{name} {recorded.get(name)} -> {found[name]}" for name in names)
        notes.append(f"resumed with another BLAS ({changes}): the numbers differ in their last bits from here on")
        progress.note(notes[-1])
    if backend == "fast" and (held := blas.held_back()):
        progress.note(held)
    run.update_manifest(blas=found, notes=notes)
