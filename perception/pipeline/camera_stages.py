"""The stages that detect vehicles: detectors in images, in dense maps and from above, their fusion, DepthCN, tracks.

With several cameras, maps, detectors and fusion run for each of them, one camera after the other with the same
networks. Each camera's detections are located in the scan, those of one object are joined there, and tracked once.
"""

import logging
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

from perception.detection.config import DetectionConfig
from perception.detection.detectors.multimodal import MultimodalDetector, MultimodalOutput
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.nms_fusion import NmsFusion
from perception.detection.fusion.source_record import SourceRecord
from perception.detection.networks import (
    chosen_detection,
    open_bev,
    open_depthcn,
    open_detectors,
    open_fusion,
)
from perception.detection.onnx_model import shipped_model
from perception.detection.vehicles.bev_joining import join_bev
from perception.detection.vehicles.camera_joining import join_cameras
from perception.detection.vehicles.locate import locate
from perception.health.camera_monitors import AllCameraMonitors, without_failed_cameras
from perception.health.miscalibration import MiscalibrationMonitor, corrected
from perception.health.monitors import is_scan_usable
from perception.health.stage_times import StageTimeMonitor
from perception.maps.densify import DenseMaps, densify
from perception.maps.projection import project_frame
from perception.pipeline.bev_stage import BevStage
from perception.pipeline.budget import TimeBudget
from perception.pipeline.config import PipelineConfig
from perception.pipeline.lidar_stages import LidarFutures, LidarResult
from perception.pipeline.skipped_stages import (
    BEV_DETECTOR,
    DEPTHCN,
    SkippableStage,
    modalities_without,
    skippable_stages,
)
from perception.pipeline.workers import StageClock
from perception.sensor import LidarModel
from perception.snapshot import Restorable
from perception.tracking.vehicles.tracker import VehicleTracker, VehicleTrackerResult
from perception.types import (
    MAP_MODALITIES,
    MODALITIES,
    Detections,
    DetectorModality,
    Frame,
    FusedDetections,
    GroundModel,
    Modality,
    ModalityDetections,
    Result,
    Vehicles,
)

log = logging.getLogger(__name__)


class CameraStages(Restorable):
    """Runs the camera stages; the vehicle tracker and the monitors remember earlier frames."""

    memories = (
        *("_tracker", "_sources", "_budget", "_noted"),
        *("_camera_monitors", "_stage_times", "_miscalibration"),
    )

    def __init__(self, sensor: LidarModel, config: PipelineConfig) -> None:
        """Open the networks.

        Args:
            sensor: LiDAR model of the scans.
            config: Pipeline configuration.

        Raises:
            ModelError: a file is missing, or does not hold the network that it is given for.
        """
        self._sensor, detection = sensor, chosen_detection(config.detection, sensor, config.method)
        self._detectors = _open_detectors(detection)
        bev = open_bev(detection, sensor)
        self._bev = (
            None if bev is None else BevStage(bev, config.area_of(sensor), detection.nms.min_score)
        )
        self._depthcn = open_depthcn(detection, sensor) if detection.depthcn.enabled else None
        self._vehicles = config.vehicles
        self._budget_s = None if config.budget_ms is None else config.budget_ms / 1e3
        self._budget, self._skips = TimeBudget(self._budget_s), tuple(config.budget_skips)
        self._noted: set[tuple[str, str]] = set()  # a camera and what it lacks
        self.reset()

    def reset(self) -> None:
        """Forget the drive so far."""
        self._tracker = VehicleTracker(self._vehicles.tracker)
        self._sources = SourceRecord()
        self._camera_monitors = AllCameraMonitors()
        self._stage_times = StageTimeMonitor(self._budget_s)
        self._miscalibration = MiscalibrationMonitor(self._sensor)

    def step(self, frame: Frame, lidar: LidarFutures, clock: StageClock) -> Result:
        """Run the stages on a frame in their order, beside those of the LiDAR worker.

        Args:
            frame: Frame of the drive.
            lidar: Results of the LiDAR stages, once they are done.
            clock: Clock of the stages.
        """
        for view in frame.views:
            self._note_missing(view)
        measured = frame
        camera = clock.run("image health", self._camera_monitors.update, frame)
        usable = without_failed_cameras(frame, camera)
        has_scan = is_scan_usable(lidar.health.result())
        # By the frames before: camera and LiDAR are joined by what their edges tell, not by a calibration that is off.
        frame = corrected(usable, self._miscalibration.correction)
        maps = clock.run("maps", _make_maps, frame) if self._uses_maps and has_scan else None
        skippable = self._skippable(frame, has_scan=has_scan)
        skipped = self._budget.stages_to_skip(skippable, clock)
        started_s, bev = clock.elapsed_s, None
        if self._bev is not None and has_scan and BEV_DETECTOR not in skipped:
            bev = self._bev.start(frame, lidar.ground)
        # A map of a scan that failed is no evidence against an object.
        modalities = modalities_without(skipped, MODALITIES if has_scan else ("rgb",))
        with self._budget.measured(skipped, clock):
            # Image and map detectors run in threads of their own, beside DepthCN in this one; then fusion.
            with clock.nested() as detector_spans:
                finish = self._start_detectors(frame, maps, modalities)
                uses_depthcn = has_scan and DEPTHCN not in skipped
                depthcn = self._detect_by_depthcn(frame, maps, clock) if uses_depthcn else None
                detections = [finish()]
                detector_spans.extend(detections[0].spans if detections[0] else ())
            detections += [
                self._detect_further(view, modalities, clock) for view in frame.views[1:]
            ]
            above = None if bev is None else bev.result()
            if above is not None:
                clock.add(above.span, started_s)
            found = None if above is None else above.vehicles
            posed = lidar.posed_ground()
            # What was seen at another time says nothing of now.
            is_now = has_scan or frame.stamp_s == lidar.result.result().scan.stamp_s
            located = None
            if found is not None or any(one is not None for one in detections):
                with clock.stage("vehicle location"):
                    located = self._locate(
                        frame, detections, found, posed.ground, has_scan=has_scan, is_now=is_now
                    )
            # What it finds changes later frames alone.
            compared = usable if has_scan else replace(usable, image=None)
            pose = posed.world_SE3_velo
            off = clock.run("calibration", self._miscalibration.update, compared, pose)
            lidar_result = lidar.result.result()
            scenes = [None if one is None else one.scene for one in detections if is_now]
            vehicles = self._track(frame, located, scenes, lidar_result, clock)
        result = lidar_result.of_frame(measured)
        if vehicles is not None:
            main, *further = (_modality_detections(one) for one in detections)
            result = replace(
                result,
                modality_detections=main,
                map_images={} if detections[0] is None else detections[0].map_images,
                vehicles=vehicles.vehicles,
                tracks=vehicles.tracks,
                further_detections=tuple(further),
            )
        spans = result.spans + clock.spans
        return replace(
            result,
            depthcn=depthcn,
            timings_s=result.timings_s | clock.seconds,
            spans=spans,
            skipped=skipped,
            health=result.health.joined(
                (*camera.findings, *self._stage_times.update(spans, skipped), *off)
            ),
        )

    @property
    def _uses_maps(self) -> bool:
        has_maps = self._detectors is not None and self._detectors.detectors.keys() != {"rgb"}
        return has_maps or self._depthcn is not None

    def _note_missing(self, frame: Frame) -> None:
        """Log once each what the detectors have to do without."""
        modalities = set(self._detectors.detectors) if self._detectors else set()
        if frame.calibration is None and (modalities or self._uses_maps):
            missing, maps = "calibration of a camera", "maps of a virtual camera"
        elif frame.image is None and "rgb" in modalities:
            missing, maps = "camera image", "maps of the scan"
        else:
            return
        if (frame.camera, missing) not in self._noted:
            above = ["the scan from above"] if self._bev is not None else []
            rest = " and ".join([maps] * self._uses_maps + above)
            vehicles = (
                f"vehicles are detected in {rest} alone" if rest else "no vehicles are detected"
            )
            log.warning("%s: no %s: %s", _named(frame), missing, vehicles)
            self._noted.add((frame.camera, missing))

    def _skippable(self, frame: Frame, *, has_scan: bool) -> list[SkippableStage]:
        """Return the stages that this frame may go without, the first of them first."""
        sources = {"rgb": frame.image is not None and frame.calibration is not None}
        detecting: list[DetectorModality] = [
            name
            for name in (self._detectors.detectors if self._detectors else ())
            if sources.get(name, has_scan)
        ]
        if self._bev is not None and has_scan:
            detecting.append("bev")
        has_depthcn = self._depthcn is not None and has_scan
        return skippable_stages(self._skips, detecting, has_depthcn=has_depthcn)

    def _start_detectors(
        self, frame: Frame, maps: DenseMaps | None, modalities: Collection[Modality]
    ) -> Callable[[], MultimodalOutput | None]:
        """Start the detectors of three modalities; return a function that waits for them and fuses.

        It returns None where they are off or lack what they look at. Without a scan, that of the image runs alone.
        """
        detectors = self._detectors
        if detectors is None:
            return lambda: None
        has_image = frame.image is not None and frame.calibration is not None
        has_maps = maps is not None and detectors.detectors.keys() != {"rgb"}
        if not has_image and not has_maps:
            return lambda: None
        return detectors.start(frame, maps, modalities)

    def _detect_further(
        self, view: Frame, modalities: Collection[Modality], clock: StageClock
    ) -> MultimodalOutput | None:
        """Return the same of the frame as a further camera sees it."""
        if self._detectors is None:
            return None
        uses_maps = any(
            name in MAP_MODALITIES and name in self._detectors.detectors for name in modalities
        )
        maps = clock.run("maps", _make_maps, view) if uses_maps else None
        with clock.nested() as spans:
            output = self._start_detectors(view, maps, modalities)()
            spans.extend(output.spans if output else ())
        return output

    def _detect_by_depthcn(
        self, frame: Frame, maps: DenseMaps | None, clock: StageClock
    ) -> Detections | None:
        """Return the detections of DepthCN; None where it is off."""
        if self._depthcn is None:
            return None
        # A network that was trained on maps of another method makes its own.
        is_same = self._depthcn.verifier.method == "default"
        with clock.stage("DepthCN"):
            return self._depthcn.verify_frame(frame, maps if is_same else None).detections

    def _fused(self, output: MultimodalOutput, camera: int) -> FusedDetections:
        """Return the fused detections of the modalities that are not blind."""
        lost = [n for n in self._sources.blind(camera) if n in output.scene.modality_detections]
        if self._detectors is None or not lost:
            return output.fused
        return self._detectors.fusion.fuse(output.scene.without(*lost))

    def _locate(
        self,
        frame: Frame,
        detections: Sequence[MultimodalOutput | None],
        found: Vehicles | None,
        ground: GroundModel,
        *,
        has_scan: bool,
        is_now: bool,
    ) -> Vehicles:
        """Return the detections in each camera and those from above on the road, each once."""
        located = {
            camera: locate(
                self._fused(one, camera) if is_now else one.fused[:0],
                frame.views[camera],
                ground,
                self._vehicles,
                uses_scan=has_scan,
            )
            for camera, one in enumerate(detections)
            if one is not None
        }
        vehicles = join_cameras(located, frame, self._vehicles.min_existence)
        if found is None or not is_now:
            return vehicles
        searched = {
            camera: self._sources.works(camera, "rgb")
            for camera, one in enumerate(detections)
            if _has_searched_image(one)
        }
        return join_bev(vehicles, found, frame, searched)

    def _track(
        self,
        frame: Frame,
        located: Vehicles | None,
        scenes: Sequence[DetectedScene | None],
        lidar: LidarResult,
        clock: StageClock,
    ) -> VehicleTrackerResult | None:
        """Return located detections as tracked vehicles, whose scenes tell which sources work."""
        if lidar.is_reset:
            self._tracker.clear()
        if located is None:
            return None
        with clock.stage("vehicles"):
            if frame.stamp_s != lidar.scan.stamp_s:
                frame = replace(frame, stamp_s=lidar.scan.stamp_s)
            self._sources.update(frame.stamp_s, located, scenes)
            pose, covariance = lidar.world_SE3_velo, lidar.scan.covariance
            return self._tracker.update(located, frame, pose, lidar.tracks, covariance)


def _modality_detections(output: MultimodalOutput | None) -> ModalityDetections:
    return {} if output is None else output.scene.modality_detections


def _named(frame: Frame) -> str:
    """Return the file of a frame and, where it is not the only one, the name of the camera, for messages."""
    return frame.source if frame.camera == Frame.camera else f"{frame.source} {frame.camera}"


def _has_searched_image(output: MultimodalOutput | None) -> bool:
    return output is not None and "rgb" in output.scene.modality_detections


def _make_maps(frame: Frame) -> DenseMaps:
    """Return the dense maps, which are made once for all detectors."""
    return densify(project_frame(frame))


def _open_detectors(config: DetectionConfig) -> MultimodalDetector | None:
    """Open the detectors and their fusion; without its network, non-maximum suppression over all modalities."""
    detectors = open_detectors(config)
    has_fusion = config.fusion_model or shipped_model("fusion_default").is_file()
    fusion = open_fusion(config) if has_fusion else NmsFusion(config.nms.max_iou)
    return MultimodalDetector(detectors, fusion) if detectors else None
