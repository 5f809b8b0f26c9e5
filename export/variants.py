"""Variants of a network, in torch and as files: size, time, and parity with torch."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
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


@dataclass(frozen=True)
class ModelVariant:
    """One variant of a network.

    Attributes:
        size_bytes: Size of the file; None of torch.
        fastest_ms: Shortest time of one batch in ms.
        parity: Parity with torch by kind of input; empty of torch.
        precision: Average precision in percent by class and IoU, then by difficulty; empty where it was not measured.
    """

    size_bytes: int | None
    fastest_ms: float
    parity: dict[str, Parity]
    precision: dict[str, dict[str, float]] = field(default_factory=dict)


def compare_variants(
    exportable: Exportable,
    models: Mapping[str, tuple[int, Network]],
    inputs: Mapping[str, Sequence[Arrays]],
    timed: Arrays,
) -> dict[str, ModelVariant]:
    """Return the variants by name, `torch` first.

    Args:
        exportable: Network in torch.
        models: Size in bytes of the other variants, and how to run them.
        inputs: Batches by their kind.
        timed: Batch that all are timed with in turn.
    """
    torch_network = torch_runner(exportable)
    networks = {"torch": torch_network} | {name: run for name, (_, run) in models.items()}
    times = fastest_ms(networks, timed)
    variants = {"torch": ModelVariant(None, times["torch"], {})}
    for name, (size_bytes, run) in models.items():
        parity = {kind: compare(torch_network, run, batches) for kind, batches in inputs.items()}
        variants[name] = ModelVariant(size_bytes, times[name], parity)
    return variants


def fastest_ms(networks: Mapping[str, Network], batch: Arrays) -> dict[str, float]:
    """Return the shortest of seven runs of each, taking turns: other load on the machine affects it least."""
    fastest = dict.fromkeys(networks, float("inf"))
    for _ in range(7):
        for name, network in networks.items():
            start = time.perf_counter()
            network(batch)
            fastest[name] = min(fastest[name], 1e3 * (time.perf_counter() - start))
    return fastest
