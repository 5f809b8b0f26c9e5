"""The detector from above as an adaptation trains it."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from data.array_store import ArrayStore
from data.label_proposals.proposed_labels import ProposedLabels
from data.recorded_drive import RecordedDrive
from data.samples.bev.dataset import BevConfig, BevDataset
from data.samples.bev.labelled_scans import LabelledScans
from data.synthetic.collection import SynthConfig
from export.adapted_network import AdaptedNetwork, Costs, MeasuredClass
from export.bev import QUANTIZATION, exportable_network, measure_networks
from export.bev_graph import streamlined
from export.onnx import Exportable, to_onnx
from export.quantize import to_int8
from export.variants import Network, fastest_ms
from perception.detection.bev.detector import BevDetector
from perception.detection.networks import SHIPPED_BEV
from perception.sensor import load_sensor
from perception.types import Progress
from train.bev.kind import BEV
from train.bev.networks import BevNetworkConfig, load_bev
from train.networks.bev_centers import BevCenters

_SENSORS = ("HDL-64E", "HDL-32E", "VLP-16")
_CROP = 0.5


class AdaptedBev(AdaptedNetwork[BevDataset]):
    """The detector from above: 8 bits, all labels around, synthetic scans of three sensors."""

    kind, out_file, flag = BEV, f"{SHIPPED_BEV}.onnx", "--pipeline.detection.bev-model"
    title = "precision from above before and after: centres within 2 m, mean of 0.5 to 4 m"
    costs = Costs(label=27, synthesis=30, sample=4.5, rest=6000)

    def __init__(self, file: Path | None, drive: RecordedDrive) -> None:
        """Open a model file; raise ModelError as `BevDetector`."""
        super().__init__(file, drive)
        self._detector = BevDetector(self.file, drive.sensor, threads=1)
        self._config = BevNetworkConfig.from_metadata(self._detector.model.metadata)

    @property
    def class_names(self) -> tuple[str, ...]:
        """Classes of the network."""
        return self._config.class_names

    @property
    def runner(self) -> Network:
        """The network of the file."""
        return self._detector.model

    def pass_ms(self) -> float:
        """Return the time of a pass over a map."""
        maps = {"maps": self._detector.preprocess(np.zeros((1, 4), np.float32))}
        return fastest_ms({"network": self.runner}, maps)["network"]

    def arguments(self) -> dict[str, object]:
        """Return classes, grid and weights of the file, and the crop of the shipped training."""
        return {
            "data.augmentation.crop": _CROP, "model.weights": self.file,
            "model.classes": list(self.class_names),
            "model.reach_m": self._config.grid.reach_m, "model.cell_m": self._config.grid.cell_m,
        }  # fmt: skip

    def synthetic(self, scans: int, seed: int) -> Mapping[str, SynthConfig]:
        """Return scans of each sensor."""
        return {
            name: SynthConfig("object", scans, sensor=load_sensor(name), images=False, seed=seed)
            for name in _SENSORS
        }

    def load(self, file: Path) -> tuple[BevCenters, dict[str, str]]:
        """Return the network of a file, and what that states."""
        return load_bev(file)

    def exportable(self, network: BevCenters, metadata: Mapping[str, str]) -> Exportable:
        """Return a network with the metadata of its model file."""
        return exportable_network(network, metadata)

    def content(self, exportable: Exportable, examples: BevDataset) -> bytes:
        """Return the model file of 8 bits."""
        maps = [{"maps": examples[row]["maps"].numpy()[None]} for row in range(len(examples))]
        return streamlined(to_int8(to_onnx(exportable), maps, QUANTIZATION))

    def samples(
        self, drives: Sequence[RecordedDrive], count: int, proposals: Mapping[str, ProposedLabels]
    ) -> BevDataset:
        """Return scans of drives."""
        scans = LabelledScans(drives, self._config.grid, ArrayStore(), proposals)
        config = BevConfig(self._config.grid, self.class_names)
        return BevDataset(scans, scans.spread(count), config)

    def measure(
        self, networks: Mapping[str, Network], samples: BevDataset, progress: Progress
    ) -> dict[str, dict[str, MeasuredClass]]:
        """Return the precision of centres."""
        measured = measure_networks(networks, samples, self._detector, progress)
        return {
            name: {kind: MeasuredClass(one.labels, one.ap, one.mean_ap) for kind, one in of.items()}
            for name, of in measured.items()
        }
