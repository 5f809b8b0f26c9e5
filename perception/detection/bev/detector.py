"""A detector of the bird's-eye view, from a model file: scan in, boxes around the vehicle out.

points -- ground, map --> network --> scores and boxes at places -- peaks, one of a group nearby, near sides at returns --> boxes
"""

from collections.abc import Mapping
from dataclasses import replace
from importlib.resources.abc import Traversable

import numpy as np

from perception.detection.bev.bev_map import BLOCK, CHANNELS, EDGES_M, BevGrid, BevMapper
from perception.detection.bev.boxes import STRIDE, BevDetections, decode_boxes, suppress
from perception.detection.bev.classes import GROUPS, VEHICLES
from perception.detection.bev.near_sides import fit_near_sides
from perception.detection.onnx_model import Array, ModelContract, ModelInput, OnnxModel
from perception.errors import ModelError
from perception.geometry.grids import LocalArea
from perception.sensor import LidarModel
from perception.types import Float32, GroundModel

_EDGES = ",".join(f"{edge:g}" for edge in EDGES_M)
CONTRACT = ModelContract(
    metadata={"kind": "bev", "modality": "bev", "edges_m": _EDGES, "stride": str(STRIDE)},
    required_keys=("classes", "reach_m", "cell_m"),
    inputs={"maps": ModelInput(np.uint8, (None, None, None, BLOCK**2, CHANNELS))},
    outputs=("scores", "boxes"),
    warmup_rows=1,
)


class BevDetector:
    """A trained network and the maps that it takes."""

    def __init__(self, model: Traversable, sensor: LidarModel, threads: int = 2) -> None:
        """Open the model file.

        Args:
            model: ONNX file.
            sensor: LiDAR model of the scans.
            threads: Number of threads of the network.

        Raises:
            ModelError: the file does not hold such a detector, or one of another input.
        """
        self.model = OnnxModel(model, CONTRACT, threads)
        """The network in ONNX Runtime."""
        stated = self.model.metadata
        self.class_names = tuple(stated["classes"].split(","))
        """Classes that it reports."""
        unknown = [name for name in self.class_names if name not in GROUPS]
        if unknown:
            raise ModelError(
                self.model.name, expected=f"classes among {', '.join(GROUPS)}", found=unknown[0]
            )
        grid = BevGrid(float(stated["reach_m"]), float(stated["cell_m"]))
        self._mapper = BevMapper(sensor, grid)
        self._are_vehicles = np.array([GROUPS[name] == VEHICLES for name in self.class_names])

    @property
    def area(self) -> LocalArea:
        """Area of the map."""
        return self._mapper.grid.area

    def detect(self, points_velo: Float32, ground: GroundModel | None = None) -> BevDetections:
        """Return the objects around in one scan, best first, in the LiDAR frame.

        Args:
            points_velo: (N, 4) points.
            ground: Ground over the area of the map; else it is estimated.

        Raises:
            ModelError: an output of the network is not finite.
        """
        ground = ground or self._mapper.ground(points_velo)
        heights_m = _heights_m(points_velo, ground)
        found = self.postprocess(
            self.model({"maps": self._mapper.make(points_velo, heights_m)[None]})
        )
        is_vehicle = self._are_vehicles[found.classes]
        found = fit_near_sides(found, is_vehicle, points_velo, heights_m)
        bottom_m = found.boxes.bottom_m.copy()
        bottom_m[:, 2] += ground.height_m(bottom_m[:, :2])
        return replace(found, boxes=replace(found.boxes, bottom_m=bottom_m))

    def preprocess(self, points_velo: Float32) -> Array:
        """Return the (1, R / 4, R / 4, 16, C) input of the network for a scan of (N, 4) points."""
        heights_m = _heights_m(points_velo, self._mapper.ground(points_velo))
        return self._mapper.make(points_velo, heights_m)[None]

    def postprocess(self, outputs: Mapping[str, Array]) -> BevDetections:
        """Return the objects of one scan by the outputs of the network, their bottoms above the ground."""
        scores, boxes, blocks = outputs["scores"][0], outputs["boxes"][0], outputs.get("blocks")
        if blocks is not None:
            boxes, blocks = boxes[:, :, 1:], blocks[1:]  # the first is there in any case
        found = decode_boxes(scores, boxes, self._mapper.grid, blocks=blocks)
        return suppress(found, [GROUPS[name] for name in self.class_names])


def _heights_m(points_velo: Float32, ground: GroundModel) -> Float32:
    return np.asarray(ground.distance_m(points_velo), np.float32)
