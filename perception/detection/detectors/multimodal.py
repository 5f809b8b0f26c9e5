"""Three detectors look at one frame: the camera's image, the depth map and the reflectance map (6.2).

    core 1   image -- rgb ------------------+-- dm --+
                                            |        +-- fusion --> vehicles
    core 2   scan -- maps ------------------+-- rm --+

The camera's image waits for no map, so that its network runs while the maps are made. A network on one
thread leaves the other core to another network: measured, this is faster than each on both cores in turn.
"""

import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Generic, NamedTuple, Protocol, TypeVar

from perception.detection.detectors.modalities import (
    MapFilling,
    camera_image,
    fill_maps,
    map_image,
)
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.detectors.nms_fusion import NmsFusion
from perception.detection.fusion.detector_fingerprints import warn_of_detector_mismatch
from perception.detection.fusion.rescoring import Fusion
from perception.errors import ModelError, UsageError
from perception.maps.densify import DenseMaps
from perception.maps.projection import camera_of, project_frame
from perception.types import (
    MAP_MODALITIES,
    MODALITIES,
    Calibration,
    Detections,
    Frame,
    FusedDetections,
    MapModality,
    Modality,
    ModalityDetections,
    StageSpan,
    UInt8,
)

Made = TypeVar("Made")


class DetectionFusion(Protocol):
    """Makes one list of what several detectors saw."""

    def fuse(
        self,
        modality_detections: ModalityDetections,
        size_px: tuple[int, int],
        dense: DenseMaps | None = None,
        camera: Calibration | None = None,
    ) -> FusedDetections:
        """Return the objects, best first, of an image of (width, height)."""
        ...


@dataclass(frozen=True)
class MultimodalOutput:
    """What the detectors make of one frame.

    Attributes:
        modality_detections: what each saw by itself; one that had nothing to look at has no entry.
        fused: what they say together.
        dense: the maps that were looked at, None where none was.
        pictures: (H, W) of each map that a detector looked at, 0 where nothing is known.
        timings_s: of each part. Parts overlap in time: all of them took less than their sum.
        spans: when each detector looked and the fusion worked, since all began; of no worker what the
            caller's thread did.
    """

    modality_detections: ModalityDetections
    fused: FusedDetections
    dense: DenseMaps | None
    pictures: Mapping[Modality, UInt8]
    timings_s: Mapping[str, float]
    spans: tuple[StageSpan, ...]


class MultimodalDetector:
    """The vehicle detector of 6.2: camera and LiDAR, any of the three modalities."""

    def __init__(
        self,
        detectors: Mapping[Modality, ModalityDetector],
        fusion: DetectionFusion | None = None,
        workers: int = 2,
    ) -> None:
        """Put detectors together.

        Args:
            detectors: one or more; open them with one thread where several work at once.
            fusion: how their detections become one list; None for the best box of each place.
            workers: so many detectors work at once.

        Raises:
            ModelError: one is of another modality, or they detect other classes.
            UsageError: there is none.
        """
        _require_alike(detectors)
        self.detectors = dict(detectors)
        """By modality."""
        self._fusion: DetectionFusion = fusion or NmsFusion()
        if isinstance(fusion, Fusion):
            warn_of_detector_mismatch(fusion, detectors)
        self._workers = ThreadPoolExecutor(workers, thread_name_prefix="detectors")

    def detect(self, frame: Frame, dense: DenseMaps | None = None) -> MultimodalOutput:
        """Detect in one frame; one without an image is seen by the LiDAR's detectors alone.

        Args:
            frame: a scan and a camera, and an image where there is one.
            dense: its maps where they are made already, filled as by `densify`'s default.

        Raises:
            CalibrationError: maps are wanted, and there is no camera to project the scan to.
            ImageError: an image is wanted by the only detector, and there is none.
            ModelError: a network yields numbers that are not finite.
        """
        frame_start_s = time.perf_counter()
        running: dict[Modality, Future[_Timed[_ModalOutput]]] = {}
        if self._uses_image(frame):
            running["rgb"] = self._start("rgb", lambda: camera_image(frame))
        maps = _timed(lambda: self._make_maps(frame, dense))
        for modality in MAP_MODALITIES:
            if modality in self.detectors:
                running[modality] = self._start(
                    modality, partial(self._map_image, modality, maps.made)
                )
        seen = {name: running[name].result() for name in MODALITIES if name in running}
        modality_detections = {name: one.made.seen for name, one in seen.items()}
        shown = next(iter(maps.made.values()), dense)
        fused = _timed(
            lambda: self._fusion.fuse(
                modality_detections, _size_px(frame), shown, frame.calibration
            )
        )
        timings_s = {"maps": maps.seconds, "fusion": fused.seconds}
        timings_s |= {str(name): one.seconds for name, one in seen.items()}
        return MultimodalOutput(
            modality_detections,
            fused.made,
            shown,
            {name: seen[name].made.image[..., 0] for name in MAP_MODALITIES if name in seen},
            timings_s,
            (
                *(one.span(f"{name} detector", frame_start_s) for name, one in seen.items()),
                replace(fused.span("fusion", frame_start_s), worker=""),
            ),
        )

    def _uses_image(self, frame: Frame) -> bool:
        is_alone = len(self.detectors) == 1
        return "rgb" in self.detectors and (frame.image is not None or is_alone)

    def _make_maps(self, frame: Frame, dense: DenseMaps | None) -> dict[MapFilling, DenseMaps]:
        """Make the maps of every way of filling that a detector asks for."""
        required = {
            self.detectors[name].filling for name in MAP_MODALITIES if name in self.detectors
        }
        made: dict[MapFilling, DenseMaps] = {}
        if dense is not None and "default" in required:
            made["default"] = dense
        if missing := sorted(required - made.keys()):
            sparse = project_frame(frame)
            made |= {filling: fill_maps(sparse, filling) for filling in missing}
        return made

    def _map_image(self, modality: MapModality, maps: Mapping[MapFilling, DenseMaps]) -> UInt8:
        return map_image(maps[self.detectors[modality].filling], modality)

    def _start(
        self, modality: Modality, image: Callable[[], UInt8]
    ) -> "Future[_Timed[_ModalOutput]]":
        """Let a detector look at a picture, which is made by whoever does this, too."""

        def detect() -> _ModalOutput:
            shown = image()
            return _ModalOutput(shown, self.detectors[modality].detect(shown))

        return self._workers.submit(_timed, detect)


class _ModalOutput(NamedTuple):
    """What a detector was shown, and what it saw."""

    image: UInt8
    seen: Detections


class _Timed(NamedTuple, Generic[Made]):
    """What was made, by which thread, and when, by `time.perf_counter`."""

    made: Made
    worker: str
    start_s: float
    stop_s: float

    @property
    def seconds(self) -> float:
        """How long it took."""
        return self.stop_s - self.start_s

    def span(self, stage: str, frame_start_s: float) -> StageSpan:
        """Return when it was made, since all began."""
        return StageSpan(
            stage, self.worker, self.start_s - frame_start_s, self.stop_s - frame_start_s
        )


def _timed(make: Callable[[], Made]) -> _Timed[Made]:
    start_s = time.perf_counter()
    made = make()
    return _Timed(made, threading.current_thread().name, start_s, time.perf_counter())


def _size_px(frame: Frame) -> tuple[int, int]:
    """Return (width, height) of the image, there or not."""
    if frame.image is not None:
        return frame.image.shape[1], frame.image.shape[0]
    return camera_of(frame)[1]


def _require_alike(detectors: Mapping[Modality, ModalityDetector]) -> None:
    if not detectors:
        raise UsageError("detectors", expected=f"one of {', '.join(MODALITIES)}", found="none")
    first = next(iter(detectors.values()))
    for modality, detector in detectors.items():
        if detector.modality != modality:
            raise ModelError(
                detector.model.name,
                expected=f"a detector of modality {modality}",
                found=f"one of {detector.modality}",
            )
        if detector.class_names != first.class_names:
            raise ModelError(
                detector.model.name,
                expected=f"classes {', '.join(first.class_names)} as of {first.model.name}",
                found=", ".join(detector.class_names),
                advice="fuse detectors that were trained for the same classes, in the same order",
            )
