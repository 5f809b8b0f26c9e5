"""A detector of one modality: a network of this package, or any ONNX detector of a known form of outputs (6.2.3).

image -- compress, crop, letterbox --> network --> boxes and scores -- NMS --> detections
"""

from collections.abc import Mapping
from dataclasses import replace
from importlib.resources.abc import Traversable

import numpy as np

from perception.detection.config import DEFAULT_NMS, NmsConfig
from perception.detection.detectors.detector_description import DescribedFile
from perception.detection.detectors.detector_network import open_network
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.modalities import CHANNELS, SHIPPED_DETECTORS
from perception.detection.detectors.network_input import (
    ImagePlacement,
    PixelRectangle,
    place,
    place_tiles,
    prepare_image,
)
from perception.detection.detectors.postprocess import (
    ScoredBoxes,
    suppressed_detections,
    top_k_boxes,
)
from perception.detection.onnx_model import Array, shipped_model
from perception.errors import ImageError
from perception.kernels.assignment import minimum_cost_pairs
from perception.types import Bool, Detections, Float64, MapFilling, Modality, UInt8

# Of the narrower of both boxes: from behind, a bicycle is as wide as a wheel.
_MIN_SHARED_WIDTH = 0.5
# A rider's height in heights of the bicycle: half hidden behind it, or upright on a child's.
_MIN_HEIGHTS, _MAX_HEIGHTS = 0.7, 3.0
_BELOW = 0.15  # of a bicycle's height: a rider's feet end above its wheels, give or take this much


def join_riders(found: Detections, persons_of: Mapping[str, str]) -> Detections:
    """Return detections with one box around each rider and bicycle, best first.

    A cyclist is as sure as person and bicycle are on average (geometric mean); a pedestrian is a person without one.

    Args:
        found: Detections, of which a bicycle has the class that it becomes with a rider.
        persons_of: Class of persons by the class of riders.
    """
    for rider, person in persons_of.items():
        found = _joined(found, found.types == rider, found.types == person)
    return found


def _joined(found: Detections, is_bicycle: Bool, is_person: Bool) -> Detections:
    bicycles, persons = np.flatnonzero(is_bicycle), np.flatnonzero(is_person)
    bicycles_px, persons_px = found.boxes_px[bicycles, None], found.boxes_px[None, persons]
    worth = np.sqrt(found.scores[bicycles, None] * found.scores[None, persons])
    worth = np.where(_is_riding(persons_px, bicycles_px), worth, 0.0)
    rows, columns = minimum_cost_pairs(-worth)
    is_pair = worth[rows, columns] > 0
    ridden, riders = bicycles[rows[is_pair]], persons[columns[is_pair]]
    scores, boxes_px = found.scores.copy(), found.boxes_px.copy()
    boxes_px[ridden, :2] = np.minimum(boxes_px[ridden, :2], boxes_px[riders, :2])
    boxes_px[ridden, 2:] = np.maximum(boxes_px[ridden, 2:], boxes_px[riders, 2:])
    scores[riders] *= 1 - found.scores[ridden]
    scores[ridden] = worth[rows, columns][is_pair]
    is_kept = ~is_bicycle
    is_kept[ridden] = True
    order = np.argsort(-scores, kind="stable")
    return Detections(boxes_px, scores, found.types)[order[is_kept[order]]]


def _is_riding(persons_px: Float64, bicycles_px: Float64) -> Bool:
    """Return which of (..., 4) persons may sit on which of (..., 4) bicycles."""
    left, top, right, bottom = np.moveaxis(persons_px, -1, 0)
    wheels_left, bar, wheels_right, ground = np.moveaxis(bicycles_px, -1, 0)
    shared = np.minimum(right, wheels_right) - np.maximum(left, wheels_left)
    narrower = np.minimum(right - left, wheels_right - wheels_left)
    height, wheels = bottom - top, ground - bar
    return np.asarray(
        (shared >= _MIN_SHARED_WIDTH * narrower)
        & (top < bar)
        & (bottom > bar)
        & (bottom <= ground + _BELOW * wheels)
        & (height >= _MIN_HEIGHTS * wheels)
        & (height <= _MAX_HEIGHTS * wheels)
    )


class ModalityDetector:
    """A trained network, from a file or of this package."""

    def __init__(
        self,
        model: Traversable | DescribedFile | Modality,
        threads: int = 2,
        nms: NmsConfig = DEFAULT_NMS,
    ) -> None:
        """Open the model file.

        Args:
            model: ONNX file, YAML file that describes one, described file, or modality of a model of this package.
            threads: Number of threads of the network.
            nms: Score threshold and suppression.

        Raises:
            ModelError: the file does not hold a detector, or one of another input or classes.
            UsageError: the YAML file holds no description of a detector.
        """
        file = shipped_model(SHIPPED_DETECTORS[model]) if isinstance(model, str) else model
        self._network = open_network(file, threads)
        self._format = self._network.format
        self._nms = nms
        self.model = self._network.model
        """The network in ONNX Runtime."""
        form = self._network.form
        self.title = self.model.name if form == "trifuse" else f"{self.model.name} ({form})"
        """Name of the file, and the form of the outputs that a network of another maker has."""
        self.modality: Modality = self._network.modality
        """Modality of the input."""
        self.class_names = self._network.classes.names
        """Classes that it reports."""
        self.size: InputSize = self._network.size
        """Input size of the training; a network for images of any size takes about as many pixels."""
        self.filling: MapFilling = self._network.description.filling or "default"
        """Filling of the maps of its training."""
        self.jpeg_quality = self._network.description.jpeg_quality
        """Quality of the JPEG compression of the images of its training, or None."""
        self.fingerprint = self._network.fingerprint
        """Hash of the model file and, where one describes it, of its YAML file."""

    @property
    def metadata(self) -> Mapping[str, str]:
        """Metadata of the model file."""
        return self.model.metadata

    def detect(
        self, image: UInt8, region: PixelRectangle | None = None, first_row: int = 0
    ) -> Detections:
        """Return the objects in an (H, W, C) image of the modality, best first, in pixels of the image.

        Args:
            image: Image of the modality.
            region: Region in which objects may be; else the whole image.
            first_row: Row above which the image shows nothing; a network of any image size is not shown the rows above.

        Raises:
            ImageError: the image has other channels than the modality.
            ModelError: an output of the network is not finite.
        """
        placements = self._placements(image, region, first_row)
        parts = [
            self._scored_boxes(self.model(self._inputs(image, one)), one, placements[0].limits)
            for one in placements
        ]
        return self._detections(image, ScoredBoxes.joined(parts))

    def preprocess(self, image: UInt8) -> Array:
        """Return the (1, C, h, w) input of the network for a whole (H, W, C) image.

        Raises:
            ImageError: the image has other channels than the modality.
        """
        placement = self._placements(image)[0]
        return self._inputs(image, placement)[self._network.image_input.name]

    def postprocess(self, image: UInt8, outputs: Mapping[str, Array]) -> Detections:
        """Return the detections in a whole (H, W, C) image by the outputs of the network for it."""
        placement = self._placements(image)[0]
        return self._detections(image, self._scored_boxes(outputs, placement, placement.limits))

    def _placements(
        self, image: UInt8, region: PixelRectangle | None = None, first_row: int = 0
    ) -> tuple[ImagePlacement, ...]:
        """Return where the image is placed in the input, once or in tiles."""
        channels = CHANNELS[self.modality]
        if image.ndim != 3 or image.shape[2] != channels or not image.size:
            raise ImageError(
                f"image for {self.model.name}",
                expected=f"shape (H, W, {channels}) of modality {self.modality}",
                found=f"shape {image.shape}",
            )
        region = region or PixelRectangle.whole(image)
        if self._format.resize == "tiles":
            return place_tiles(region, self.size)
        size = self._network.size_for(region.height_px, region.width_px)
        placement = place(region, size, self._format.resize, self._format.alignment)
        if first_row > region.top and not self._network.is_size_fixed:
            placement = placement.from_row(first_row)
        return (placement,)

    def _inputs(self, image: UInt8, placement: ImagePlacement) -> dict[str, Array]:
        shown = prepare_image(
            image, self.modality, placement, self.jpeg_quality, self._format.pad_value
        )
        return self._network.inputs(shown)

    def _scored_boxes(
        self, outputs: Mapping[str, Array], placement: ImagePlacement, whole: PixelRectangle
    ) -> ScoredBoxes:
        """Return the best boxes in pixels of the image, without what a tile of the whole region cuts."""
        found = self._network.predict(outputs, placement.size)
        best = top_k_boxes(found.boxes_px, found.scores, self._nms)
        placed = replace(best, boxes_px=placement.to_image(best.boxes_px))
        if placement.limits == whole:
            return placed
        # Of an object that a tile cuts, another tile or the whole image shows more.
        return placed.of_rows(~placement.is_cut(placed.boxes_px, whole))

    def _detections(self, image: UInt8, boxes: ScoredBoxes) -> Detections:
        height, width = image.shape[:2]
        size = InputSize(height, width)
        found = suppressed_detections(boxes, self.class_names, size, self._nms)
        found = join_riders(found, self._network.classes.persons_of)
        # To the centres of the outermost pixels, as in KITTI's labels.
        return replace(found, boxes_px=np.minimum(found.boxes_px, [width - 1, height - 1] * 2))
