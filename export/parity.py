"""Parity of a model file with its checkpoint: the largest difference of the outputs for the same inputs."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from export.onnx import Exportable
from perception.errors import ModelError

Arrays = Mapping[str, NDArray[Any]]
Network = Callable[[Arrays], Arrays]


@dataclass(frozen=True)
class Parity:
    """Differences of two variants of a network.

    Attributes:
        rows: Number of rows that were compared.
        largest: Largest difference of each output.
    """

    rows: int
    largest: dict[str, float]

    def require(self, tolerances: Mapping[str, float], where: str) -> None:
        """Validate that the differences are within their tolerances.

        Raises:
            ModelError: an output is.
        """
        for name, largest in self.largest.items():
            if not largest <= tolerances[name]:  # NaN is within nothing
                raise ModelError(
                    where,
                    expected=f"{name} within {tolerances[name]:g} of the checkpoint's",
                    found=f"a difference of {largest:g} on {self.rows} rows",
                    advice="the model was not written; the report has all figures",
                )


def compare(reference: Network, other: Network, batches: Iterable[Arrays]) -> Parity:
    """Run both on every batch; what has no rows must come out alike, too.

    Raises:
        ModelError: an output has another shape.
    """
    rows, largest = 0, dict[str, float]()
    for batch in batches:
        expected, found = reference(batch), other(batch)
        rows += len(next(iter(batch.values())))
        for name, array in expected.items():
            if found[name].shape != array.shape:
                raise ModelError(
                    f"output {name}",
                    expected=f"shape {array.shape} as of the checkpoint",
                    found=f"{found[name].shape}",
                )
            difference = np.abs(array.astype(np.float64) - found[name]).max(initial=0.0)
            largest[name] = float(np.maximum(largest.get(name, 0.0), difference))
    return Parity(rows, largest)


def torch_runner(exportable: Exportable) -> Network:
    """Return the module as a function of arrays."""

    def run(batch: Arrays) -> Arrays:
        tensors = [torch.from_numpy(batch[name]) for name in exportable.inputs]
        with torch.inference_mode():
            found = exportable.module(*tensors)
        outputs = found if isinstance(found, tuple) else (found,)
        return {
            name: output.numpy() for name, output in zip(exportable.outputs, outputs, strict=True)
        }

    return run
