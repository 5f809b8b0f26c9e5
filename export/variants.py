"""A network in torch and as files, side by side: size, time, and how far each is from torch."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from export.latency import fastest_ms
from export.onnx import Exportable
from export.parity import Arrays, Network, Parity, compare, torch_runner


@dataclass(frozen=True)
class ModelVariant:
    """One form of a network.

    Attributes:
        size_bytes: Size of the file; None of torch.
        fastest_ms: Shortest time of one batch in ms.
        parity: Parity with torch by kind of input; empty of torch.
        precision: average precision in percent by class and overlap, then by difficulty; empty where it
            was not measured.
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
    """Return the forms by name, `torch` first.

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
