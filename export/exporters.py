"""Exporters of all networks, by the kind of model that their checkpoints state."""

from collections.abc import Callable, Mapping

from export.bev import export_bev
from export.depthcn import export_verifier
from export.detector import export_detector
from export.fusion import export_fusion
from export.result import ExportConfig, ExportResult
from train.checkpoints import read_checkpoint

Exporter = Callable[[ExportConfig], ExportResult]

EXPORTERS: Mapping[str, Exporter] = {
    "bev": export_bev,
    "depthcn": export_verifier,
    "detector": export_detector,
    "fusion": export_fusion,
}


def export_network(config: ExportConfig) -> ExportResult:
    """Make the files of a checkpoint of any network.

    Raises:
        ModelError: it is damaged, or of a network that is not known.
        UsageError: a setting does not apply to the network.
    """
    content = read_checkpoint(config.checkpoint, *EXPORTERS)
    return EXPORTERS[content["hyper_parameters"]["model"]](config)
