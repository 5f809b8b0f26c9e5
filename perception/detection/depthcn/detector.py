"""DepthCN: what stands on the road, and which of it are vehicles (6.1).

scan -- propose --> candidates -- windows --> crops of the picture -- network --> scores and boxes,
of which overlapping ones leave only the best: detections.
"""

from dataclasses import dataclass
from importlib.abc import Traversable

import numpy as np

from perception.detection.config import DEFAULT_NMS, NmsConfig, ProposalConfig
from perception.detection.depthcn.image import encode_channels
from perception.detection.depthcn.proposals import Proposals, propose
from perception.detection.depthcn.verifier import VEHICLE, Verifier, VerifierPrediction
from perception.detection.depthcn.windows import windows_px
from perception.detection.suppression import suppress
from perception.maps.densify import DenseMaps, densify
from perception.maps.projection import camera_of, project_frame
from perception.sensor import HDL_64E, LidarModel
from perception.types import Calibration, Detections, Float64, Frame, Int, Method


@dataclass(frozen=True)
class VerifiedProposals:
    """The M candidates of one frame as the network judges them.

    Attributes:
        proposals: (M)
        windows_px: (M, 4) where the network looked.
        scores: (M,) probability of a vehicle.
        boxes_px: (M, 4) of the vehicle that it would be, within the image.
        kept: (K,) rows that are detections, best first.
    """

    proposals: Proposals
    windows_px: Float64
    scores: Float64
    boxes_px: Float64
    kept: Int

    @property
    def detections(self) -> Detections:
        """(K) vehicles, best first."""
        return _vehicles(self.boxes_px[self.kept], self.scores[self.kept])

    @property
    def owners(self) -> Int:
        """(N,) for each point of the scan the detection that it belongs to, or -1."""
        return self.proposals[self.kept].clusters


class DepthCn:
    """The vehicle detector of chapter 6; it sees with the LiDAR alone."""

    def __init__(
        self,
        model: Traversable | Method = "default",
        sensor: LidarModel = HDL_64E,
        *,
        proposals: ProposalConfig | None = None,
        nms: NmsConfig = DEFAULT_NMS,
        threads: int = 2,
    ) -> None:
        """Open the network.

        Args:
            model: file of a network, or default for the one that ships.
            sensor: LiDAR that the scans are from.
            proposals: Proposal parameters; else those of the network's method.
            nms: Score threshold and suppression.
            threads: that the network runs on.

        Raises:
            ModelError: the file does not hold a network of this detector.
        """
        self.verifier = Verifier(model, threads)
        self._sensor = sensor
        self._method = self.verifier.method
        self._proposals = proposals
        self._nms = nms

    def detect(self, frame: Frame) -> Detections:
        """Return the vehicles in view of a frame's camera, best first; its image is not needed.

        Raises:
            CalibrationError: the frame has no camera, or nothing says how large its image is.
        """
        return self.verify_frame(frame).detections

    def verify_frame(self, frame: Frame, dense: DenseMaps | None = None) -> VerifiedProposals:
        """Return all candidates of a frame and what the network says of each.

        Args:
            frame: a scan and a camera.
            dense: its maps where they are made already.
        """
        proposals = self.propose(frame)
        dense = self.densify(frame) if dense is None else dense
        calibration, _ = camera_of(frame)
        return self.verify(proposals, dense, calibration)

    def propose(self, frame: Frame) -> Proposals:
        """Find the candidates of a frame."""
        calibration, size_px = camera_of(frame)
        return propose(frame.points_velo, calibration, size_px, self._proposals, self._method)

    def densify(self, frame: Frame) -> DenseMaps:
        """Make the maps of a frame."""
        return densify(project_frame(frame), self._method)

    def verify(
        self, proposals: Proposals, dense: DenseMaps, calibration: Calibration
    ) -> VerifiedProposals:
        """Judge candidates that are found already, by maps of the same scan."""
        focal_px = float(calibration.image_P_cam[0, 0])
        windows = windows_px(self.verifier.window, proposals.boxes_px, proposals.depths_m, focal_px)
        prediction = VerifierPrediction.empty()
        if len(proposals):
            image = encode_channels(dense, calibration.image_P_velo, self._sensor.height_m)
            prediction = self.verifier.predict(image, windows)
        boxes_px = _within_image(prediction.boxes_px, dense.depth_m.shape)
        kept = self._keep(boxes_px, prediction.scores)
        return VerifiedProposals(proposals, windows, prediction.scores, boxes_px, kept)

    def _keep(self, boxes_px: Float64, scores: Float64) -> Int:
        """Return the rows that are likely, show in the image, and are the best of their place."""
        shows = (boxes_px[:, 2:] > boxes_px[:, :2]).all(axis=1)
        rows = np.flatnonzero(shows & (scores >= self._nms.min_score))
        likely = _vehicles(boxes_px[rows], scores[rows])
        return np.asarray(rows[suppress(likely, self._nms.max_iou)])


def _vehicles(boxes_px: Float64, scores: Float64) -> Detections:
    return Detections(boxes_px, scores, np.full(len(scores), VEHICLE))


def _within_image(boxes_px: Float64, shape: tuple[int, ...]) -> Float64:
    """Clip (M, 4) boxes to the centres of the outermost pixels, as KITTI's labels are."""
    height, width = shape
    return np.asarray(np.clip(boxes_px, 0, [width - 1, height - 1] * 2))
