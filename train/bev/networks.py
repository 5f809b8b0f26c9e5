"""The network of the bird's-eye view, with random weights or read from a checkpoint or a model file."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from data.samples.bev.dataset import BevConfig
from perception.detection.bev.bev_map import CHANNELS, EDGES_M, BevGrid
from perception.detection.bev.boxes import STRIDE
from train.checkpoint_writer import require_same
from train.checkpoints import Content, load_network
from train.exported_weights import load_exported
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


def initial_network(
    config: BevNetworkConfig, weights: Path | None
) -> tuple[BevCenters, Mapping[str, str]]:
    """Return the network, and what the file of its weights states; a class that the file does not know has random ones.

    Args:
        config: Input and classes.
        weights: Checkpoint or model file; None for random weights.

    Raises:
        ModelError: the file is damaged, of another kind of network, or of other cells.
    """
    network = make_network(config)
    if weights is None:
        return network, {}
    trained, stated = load_bev(weights)
    hyper_parameters = {"model": MODEL, **config.metadata}
    require_same(weights, hyper_parameters, stated, ("cell_m", "edges_m", "stride"))
    shared = [name for name in network.class_names if name in trained.class_names]
    rows = [network.class_names.index(name) for name in shared]
    trained_rows = [trained.class_names.index(name) for name in shared]
    state, last = trained.state_dict(), len(network.score_head) - 1
    for name in (f"score_head.{last}.weight", f"score_head.{last}.bias"):
        mixed = network.state_dict()[name].clone()
        mixed.view(len(network.class_names), -1)[rows] = state[name].view(
            len(trained.class_names), -1
        )[trained_rows]
        state[name] = mixed
    network.load_state_dict(state)
    return network.train(), stated


def load_bev(file: Path) -> tuple[BevCenters, dict[str, str]]:
    """Return a trained network in evaluation mode, and the metadata of its model file.

    Args:
        file: Checkpoint, or model file, from which weights of 8 bits are read in full precision.

    Raises:
        ModelError: the file is damaged, or of another kind of network.
    """

    def of_stated(stated: Mapping[str, Any]) -> BevCenters:
        return make_network(BevNetworkConfig.from_metadata(stated))

    def make(content: Content) -> tuple[BevCenters, dict[str, str]]:
        stated = content["hyper_parameters"]
        names = BevNetworkConfig.from_metadata(stated).metadata
        return of_stated(stated), {
            name: str(stated.get(name, text)) for name, text in names.items()
        }

    if file.suffix == ".onnx":
        network, stated = load_exported(file, MODEL, of_stated)
        network.trunk.blocks.weight.data /= network.trunk.scale  # the file's are of whole numbers
        return network, stated
    return load_network(file, MODEL, make)
