"""The network of the bird's-eye view, with random weights or read from a checkpoint."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from data.samples.bev.dataset import BevConfig
from perception.detection.bev.bev_map import CHANNELS, EDGES_M, BevGrid
from perception.detection.bev.boxes import STRIDE
from train.checkpoint_writer import require_same_network
from train.checkpoints import Content, load_network
from train.networks.bev_centers import BevCenters

MODEL = "bev"  # kind of model in checkpoints and model files
IDENTITY = ("classes", "cell_m")  # hyperparameters of which the meaning of weights depends


@dataclass(frozen=True)
class BevNetworkConfig(BevConfig):
    """Input and classes of the network, as model files state them."""

    @property
    def metadata(self) -> dict[str, str]:
        """Texts that model files state."""
        return {
            "kind": MODEL,
            "modality": "bev",
            "classes": ",".join(self.class_names),
            "reach_m": f"{self.grid.reach_m:g}",
            "cell_m": f"{self.grid.cell_m:g}",
            "edges_m": ",".join(f"{edge:g}" for edge in EDGES_M),
            "stride": str(STRIDE),
        }

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, Any]) -> Self:
        """Return the configuration that a model file or checkpoint states."""
        grid = BevGrid(float(metadata["reach_m"]), float(metadata["cell_m"]))
        return cls(grid, tuple(metadata["classes"].split(",")))


def make_network(config: BevConfig) -> BevCenters:
    """Return a network with random weights."""
    return BevCenters(config.class_names, CHANNELS)


def initial_network(config: BevNetworkConfig, checkpoint: Path | None) -> BevCenters:
    """Return the network with random weights, or those of a checkpoint; a class that it does not know has random ones.

    Raises:
        ModelError: the checkpoint is damaged, of another kind of network, or of other cells.
    """
    network = make_network(config)
    if checkpoint is None:
        return network
    require_same_network(
        checkpoint, {"model": MODEL, **config.metadata}, ("cell_m", "edges_m", "stride")
    )
    trained, _ = load_bev(checkpoint)
    shared = [name for name in network.class_names if name in trained.class_names]
    rows = [network.class_names.index(name) for name in shared]
    trained_rows = [trained.class_names.index(name) for name in shared]
    weights, last = trained.state_dict(), len(network.score_head) - 1
    for name in (f"score_head.{last}.weight", f"score_head.{last}.bias"):
        mixed = network.state_dict()[name].clone()
        mixed.view(len(network.class_names), -1)[rows] = weights[name].view(
            len(trained.class_names), -1
        )[trained_rows]
        weights[name] = mixed
    network.load_state_dict(weights)
    return network


def load_bev(checkpoint: Path) -> tuple[BevCenters, dict[str, str]]:
    """Return a trained network in evaluation mode, and the metadata of its model file.

    Raises:
        ModelError: the checkpoint is damaged, or of another kind of network.
    """

    def make(content: Content) -> tuple[BevCenters, dict[str, str]]:
        config = BevNetworkConfig.from_metadata(content["hyper_parameters"])
        return make_network(config), config.metadata

    return load_network(checkpoint, MODEL, make)
