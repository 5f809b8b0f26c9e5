"""The stage that detects in the scan from above, in a thread of its own beside both workers."""

import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple

from perception.detection.bev.detector import BevDetector
from perception.detection.vehicles.bev_objects import bev_vehicles
from perception.geometry.grids import LocalArea
from perception.geometry.threads import limit_blas_threads
from perception.pipeline.lidar_stages import PosedGround
from perception.pipeline.skipped_stages import BEV_DETECTOR
from perception.types import Frame, StageSpan, Vehicles


class BevOutput(NamedTuple):
    """Vehicles of the bird's-eye view, and the time that they took since the stage was started."""

    vehicles: Vehicles
    span: StageSpan


class BevStage:
    """Detects in scans from above, on the ground of the pipeline where that covers the map."""

    def __init__(self, detector: BevDetector, area: LocalArea, min_score: float) -> None:
        """Start the thread.

        Args:
            detector: Detector of the bird's-eye view.
            area: Area of the pipeline's ground.
            min_score: Score below which nothing is reported.
        """
        self.detector = detector
        """Detector of the bird's-eye view."""
        self._min_score = min_score
        self._uses_ground = area.covers(detector.area)
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="bev")

    def start(self, frame: Frame, ground: "Future[PosedGround | None]") -> "Future[BevOutput]":
        """Start on a frame.

        Args:
            frame: Frame with a scan that can be used.
            ground: Ground of the pipeline and its pose, once known; None where they are of another scan.
        """
        return self._worker.submit(self._detect, frame, ground, time.perf_counter())

    def _detect(
        self, frame: Frame, ground: "Future[PosedGround | None]", started_s: float
    ) -> BevOutput:
        posed = ground.result() if self._uses_ground else None
        start_s = time.perf_counter() - started_s
        with limit_blas_threads():
            found = self.detector.detect(frame.points_velo, posed and posed.ground)
            vehicles = bev_vehicles(found, self.detector.class_names, frame, self._min_score)
        stop_s, worker = time.perf_counter() - started_s, threading.current_thread().name
        return BevOutput(vehicles, StageSpan(BEV_DETECTOR, worker, start_s, stop_s))
