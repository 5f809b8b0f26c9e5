"""Detection in one frame by up to three networks: camera image, depth map and reflectance map (6.2).

    core 1   image -- rgb ------------------+-- dm --+
                                            |        +-- fusion --> vehicles
    core 2   scan -- maps ------------------+-- rm --+

The image detector does not wait for the maps: its network runs while they are made. Networks with one thread each
run side by side, which is faster than one after the other with two threads (measured).
"""

import threading
import time
from collections.abc import Callable, Collection, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Generic, NamedTuple, TypeVar

from perception.detection.detectors.image_region import detection_region, first_observed_row
from perception.detection.detectors.modalities import camera_image, fill_maps, map_image
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.detectors.network_input import PixelRectangle
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.detector_fusion import DetectionFusion, fusion_of
from perception.detection.fusion.nms_fusion import NmsFusion
from perception.detection.fusion.rescoring import Fusion
from perception.errors import ModelError, UsageError
from perception.maps.densify import DenseMaps
from perception.maps.projection import camera_of, project_frame
from perception.types import (
    MAP_MODALITIES,
    MODALITIES,
    Detections,
    Frame,
    FusedDetections,
    MapFilling,
    Modality,
    StageSpan,
    UInt8,
)

Value = TypeVar("Value")


@dataclass(frozen=True)
class MultimodalOutput:
    """Detections in one frame.

    Attributes:
        scene: Detections by modality; a detector that had no input has no entry.
        fused: Fused detections.
        dense: Dense maps that were used, or None.
        map_images: (H, W) map image of each modality that was used, 0 where unknown.
        timings_s: Times of the parts in seconds; they overlap, so that their sum exceeds the total.
        spans: Times of the detectors and of the fusion in seconds since the start; the fusion runs in the
            caller's thread and names no worker.
    """

    scene: DetectedScene
    fused: FusedDetections
    dense: DenseMaps | None
    map_images: Mapping[Modality, UInt8]
    timings_s: Mapping[str, float]
    spans: tuple[StageSpan, ...]


class MultimodalDetector:
    """The vehicle detector of section 6.2: camera and LiDAR, with any of the three modalities."""

    def __init__(
        self,
        detectors: Mapping[Modality, ModalityDetector],
        fusion: DetectionFusion | None = None,
        workers: int = 2,
    ) -> None:
        """Combine detectors.

        Args:
            detectors: Detectors by modality, with one thread each where several run at once.
            fusion: Fusion of their detections; else non-maximum suppression.
            workers: Number of detectors that run at once.

        Raises:
            ModelError: a detector has another modality than its key.
            UsageError: there is no detector.
        """
        _validate(detectors)
        self.detectors = dict(detectors)
        """Detectors by modality."""
        self.fusion: DetectionFusion = fusion or NmsFusion()
        """Fusion of their detections."""
        if isinstance(fusion, Fusion):
            self.fusion = fusion_of(fusion, detectors)
        self._workers = ThreadPoolExecutor(workers, thread_name_prefix="detectors")

    def detect(self, frame: Frame, dense: DenseMaps | None = None) -> MultimodalOutput:
        """Detect in one frame; without an image and its calibration, the map detectors run alone.

        Args:
            frame: Scan and camera, with an image where there is one.
            dense: Dense maps of the frame by the default filling, where they exist already.

        Raises:
            ImageError: the only detector needs an image, and the frame has none.
            ModelError: an output of a network is not finite.
        """
        return self.start(frame, dense)()

    def start(
        self,
        frame: Frame,
        dense: DenseMaps | None = None,
        modalities: Collection[Modality] = MODALITIES,
    ) -> Callable[[], MultimodalOutput]:
        """Start the detectors in threads of their own; return a function that waits for them and fuses.

        Args:
            frame: Scan and camera, as in `detect`, whose errors the function raises.
            dense: Dense maps of the frame by the default filling, where they exist already.
            modalities: Modalities whose detectors run; a map of a scan that failed is no evidence against an object.
        """
        start_s = time.perf_counter()
        size_px = self._image_size_px(frame)
        region = detection_region(frame.calibration, size_px)
        running: dict[Modality, Future[_Timed[_ModalityOutput]]] = {}
        if "rgb" in modalities and self._uses_image(frame):
            running["rgb"] = self._start("rgb", lambda: camera_image(frame), region)
        by_maps = [name for name in MAP_MODALITIES if name in self.detectors and name in modalities]
        maps = _time(lambda: self._make_maps(frame, dense, by_maps))
        for modality in by_maps:
            dense_maps = maps.value[self.detectors[modality].filling]
            first_row = first_observed_row(dense_maps.is_measured)
            image = partial(map_image, dense_maps, modality)
            running[modality] = self._start(modality, image, region, first_row)

        def finish() -> MultimodalOutput:
            outputs = {name: running[name].result() for name in MODALITIES if name in running}
            detections = {name: one.value.detections for name, one in outputs.items()}
            used = next(iter(maps.value.values()), dense)
            class_names = {name: one.class_names for name, one in self.detectors.items()}
            scene = DetectedScene(detections, size_px, class_names)
            fused = _time(lambda: self.fusion.fuse(scene))
            timings_s = {"maps": maps.seconds, "fusion": fused.seconds}
            timings_s |= {str(name): one.seconds for name, one in outputs.items()}
            images: dict[Modality, UInt8] = {
                name: outputs[name].value.image[..., 0]
                for name in MAP_MODALITIES
                if name in outputs
            }
            spans = [one.span(f"{name} detector", start_s) for name, one in outputs.items()]
            spans.append(replace(fused.span("fusion", start_s), worker=""))
            return MultimodalOutput(scene, fused.value, used, images, timings_s, tuple(spans))

        return finish

    def _uses_image(self, frame: Frame) -> bool:
        if self._needs_no_maps:
            return True
        has_image = frame.image is not None and frame.calibration is not None
        return "rgb" in self.detectors and has_image

    @property
    def _needs_no_maps(self) -> bool:
        return self.detectors.keys() == {"rgb"}

    def _image_size_px(self, frame: Frame) -> tuple[int, int]:
        """Return the (width, height) of the image of the detections."""
        if self._needs_no_maps and frame.calibration is None:
            height_px, width_px = camera_image(frame).shape[:2]
            return width_px, height_px
        return camera_of(frame)[1]

    def _make_maps(
        self, frame: Frame, dense: DenseMaps | None, modalities: Iterable[Modality]
    ) -> dict[MapFilling, DenseMaps]:
        """Return the dense maps by each filling that the detectors of some modalities need."""
        required = {self.detectors[name].filling for name in modalities}
        made: dict[MapFilling, DenseMaps] = {}
        if dense is not None and "default" in required:
            made["default"] = dense
        if missing := sorted(required - made.keys()):
            sparse = project_frame(frame)
            made |= {filling: fill_maps(sparse, filling) for filling in missing}
        return made

    def _start(
        self,
        modality: Modality,
        make_image: Callable[[], UInt8],
        region: PixelRectangle,
        first_row: int = 0,
    ) -> "Future[_Timed[_ModalityOutput]]":
        """Let a worker make the input image and detect in a region of it, from a row on."""

        def detect() -> _ModalityOutput:
            image = make_image()
            detections = self.detectors[modality].detect(image, region, first_row)
            return _ModalityOutput(image, detections)

        return self._workers.submit(_time, detect)


class _ModalityOutput(NamedTuple):
    """Input image and detections of one detector."""

    image: UInt8
    detections: Detections


class _Timed(NamedTuple, Generic[Value]):
    """A value with the thread that made it, and start and stop by `time.perf_counter`."""

    value: Value
    worker: str
    start_s: float
    stop_s: float

    @property
    def seconds(self) -> float:
        """Elapsed time."""
        return self.stop_s - self.start_s

    def span(self, stage: str, origin_s: float) -> StageSpan:
        """Return the time span relative to an origin."""
        return StageSpan(stage, self.worker, self.start_s - origin_s, self.stop_s - origin_s)


def _time(make: Callable[[], Value]) -> _Timed[Value]:
    start_s = time.perf_counter()
    value = make()
    return _Timed(value, threading.current_thread().name, start_s, time.perf_counter())


def _validate(detectors: Mapping[Modality, ModalityDetector]) -> None:
    if not detectors:
        raise UsageError("detectors", expected=f"one of {', '.join(MODALITIES)}", found="none")
    for modality, detector in detectors.items():
        if detector.modality != modality:
            raise ModelError(
                detector.model.name,
                expected=f"a detector of modality {modality}",
                found=f"one of {detector.modality}",
            )
