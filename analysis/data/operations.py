"""``operations.json`` of a run: what one decision of its trained policy costs, counted over evaluation episodes.

``docs/run-directory.md`` says what each field means. Every number is an average over decisions.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from analysis.data.errors import UnreadableRunError
from analysis.data.files import read_text

_MEGABYTES = 4
_Count = Annotated[float, Field(ge=0, le=1e18)]
_Whole = Annotated[int, Field(ge=0, le=10**18)]
_Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
#: Columns of a study's frame of operations, after those that name the run.
COLUMNS = [
    "decisions",
    "episodes",
    "mac_dense",
    "mac_effective",
    "ac_dense",
    "ac_effective",
    "weights",
    "zero_weights",
    "neuron_updates",
    "neurons",
    "encoder_exponentials",
    "random_numbers",
    "activation_sparsity",
    "footprint_bytes",
]


class Layer(BaseModel):
    """A connection layer; ``dense`` and ``effective`` operations a decision, MACs or ACs by ``kind``."""

    model_config = ConfigDict(extra="forbid")
    name: str
    kind: Literal["MAC", "AC"]
    dense: _Count
    effective: _Count
    weights: _Whole
    zero_weights: _Whole


class Operations(BaseModel):
    """The whole file."""

    model_config = ConfigDict(extra="forbid")
    decisions: Annotated[int, Field(ge=1, le=10**18)]
    episodes: Annotated[int, Field(ge=1, le=10**18)]
    layers: list[Layer]
    neuron_updates: _Count
    neurons: _Whole
    encoder_exponentials: _Count
    random_numbers: _Count
    activation_sparsity: _Share
    footprint_bytes: _Whole

    def totals(self) -> dict[str, Any]:
        """One row of the frame, columns ``COLUMNS``."""
        row: dict[str, Any] = {name: getattr(self, name) for name in COLUMNS if name in Operations.model_fields}
        for kind in ("MAC", "AC"):
            mine = [layer for layer in self.layers if layer.kind == kind]
            row[f"{kind.lower()}_dense"] = sum(layer.dense for layer in mine)
            row[f"{kind.lower()}_effective"] = sum(layer.effective for layer in mine)
        row["weights"] = sum(layer.weights for layer in self.layers)
        row["zero_weights"] = sum(layer.zero_weights for layer in self.layers)
        return row


def read_operations(path: Path, warnings: list[str]) -> Operations | None:
    """The file; None where there is none, and with a warning where it is damaged (no return depends on it)."""
    try:
        return Operations.model_validate_json(read_text(path, _MEGABYTES))
    except FileNotFoundError:
        return None
    except UnreadableRunError as error:
        warnings.append(f"{error}; its operations were left out")
        return None
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "the file"
        warnings.append(f"its operations.json is damaged ({where}: {first['msg']}); its operations were left out")
        return None
