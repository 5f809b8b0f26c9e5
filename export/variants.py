"""Variants of a network, in torch and as files: size, time, and parity with torch."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from export.onnx import Exportable
from export.parity import Arrays, Network, Parity, compare, torch_runner


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


def fastest_ms(networks: Mapping[str, Network], batch: Arrays, rounds: int = 7) -> dict[str, float]:
    """Return the shortest run of each, taking turns: other load on the machine affects it least."""
    fastest = dict.fromkeys(networks, float("inf"))
    for _ in range(rounds):
        for name, network in networks.items():
            start = time.perf_counter()
            network(batch)
            fastest[name] = min(fastest[name], 1e3 * (time.perf_counter() - start))
    return fastest
