"""DepthCN: vehicle proposals of the LiDAR, verified by a network (6.1).

scan -- propose, size --> proposals -- windows --> crops of the maps -- network --> scores and boxes -- NMS --> detections

The thesis verifies its proposals and suppresses none.
"""

from dataclasses import dataclass
from importlib.resources.abc import Traversable

import numpy as np

from perception.detection.config import DEFAULT_NMS, PROPOSAL_CONFIGS, NmsConfig, ProposalOverrides
from perception.detection.depthcn.crops import windows_px
from perception.detection.depthcn.image import encode_channels
from perception.detection.depthcn.proposals import Proposals, propose
from perception.detection.depthcn.verifier import Verifier, VerifierPrediction
from perception.detection.suppression import suppress
from perception.maps.densify import DenseMaps, densify
from perception.maps.projection import camera_of, project_frame
from perception.sensor import HDL_64E, LidarModel
from perception.types import Calibration, Detections, Float64, Frame, Int, Method


@dataclass(frozen=True)
class VerifiedProposals:
    """M proposals of one frame with the predictions of the network.

    Attributes:
        proposals: (M) proposals.
        windows_px: (M, 4) windows x1 y1 x2 y2 of the network's crops.
        found: (M) predicted boxes within the image, with probability and name of the likeliest class.
        kept: (K,) rows of the detections, best first.
    """

    proposals: Proposals
    windows_px: Float64
    found: Detections
    kept: Int

    @property
    def detections(self) -> Detections:
        """(K) detected objects, best first."""
        return self.found[self.kept]

    @property
    def scores(self) -> Float64:
        """(M,) probabilities of the likeliest class."""
        return self.found.scores

    @property
    def boxes_px(self) -> Float64:
        """(M, 4) predicted boxes x1 y1 x2 y2 within the image."""
        return self.found.boxes_px

    @property
    def owners(self) -> Int:
        """(N,) index of the detection of each point of the scan, or -1."""
        return self.proposals[self.kept].clusters


# Width in the image, in metres at the proposal's depth, and height above the ground from which a proposal is verified. A
# quarter of all clusters are narrower or lower: poles, trunks, kerbs. On synthetic streets precision is better without.
MIN_SIZE_M = (0.3, 0.6)
_NO_OVERRIDES = ProposalOverrides()
_NO_SUPPRESSION = 1.0  # no overlap exceeds it


class DepthCn:
    """The LiDAR vehicle detector of section 6.1."""

    def __init__(
        self,
        model: Traversable | Method = "default",
        sensor: LidarModel = HDL_64E,
        *,
        proposals: ProposalOverrides = _NO_OVERRIDES,
        nms: NmsConfig = DEFAULT_NMS,
        threads: int = 2,
    ) -> None:
        """Open the network.

        Args:
            model: Model file, or the method of a model of this package.
            sensor: LiDAR of the scans.
            proposals: Proposal parameters in place of those of the network's method.
            nms: Score threshold and suppression; the thesis' network verifies all proposals and suppresses none.
            threads: Number of threads of the network.

        Raises:
            ModelError: the file does not hold a network of this detector.
        """
        self.verifier = Verifier(model, threads)
        self._sensor = sensor
        self._method = self.verifier.method
        self._proposals = proposals.over(PROPOSAL_CONFIGS[self._method])
        self._min_score = nms.min_score
        is_thesis = self._method == "thesis"
        self._min_size_m = (0.0, 0.0) if is_thesis else MIN_SIZE_M
        self._max_iou = _NO_SUPPRESSION if is_thesis else nms.max_iou

    def detect(self, frame: Frame) -> Detections:
        """Return the vehicles in the camera's view, best first; the image is not used."""
        return self.verify_frame(frame).detections

    def verify_frame(self, frame: Frame, dense: DenseMaps | None = None) -> VerifiedProposals:
        """Return all proposals of a frame with the predictions of the network.

        Args:
            frame: Scan and camera.
            dense: Dense maps of the frame, where they exist already.
        """
        proposals = self.propose(frame)
        dense = self.densify(frame) if dense is None else dense
        calibration, _ = camera_of(frame)
        return self.verify(proposals, dense, calibration)

    def propose(self, frame: Frame) -> Proposals:
        """Find the proposals of a frame that are large enough to be verified."""
        calibration, size_px = camera_of(frame)
        found = propose(frame.points_velo, calibration, size_px, self._proposals, self._method)
        return found[found.has_min_size(self._min_size_m, float(calibration.image_P_cam[0, 0]))]

    def densify(self, frame: Frame) -> DenseMaps:
        """Return the dense maps of a frame."""
        return densify(project_frame(frame), self._method)

    def verify(
        self, proposals: Proposals, dense: DenseMaps, calibration: Calibration
    ) -> VerifiedProposals:
        """Verify proposals by the dense maps of the same frame."""
        focal_px = float(calibration.image_P_cam[0, 0])
        windows = windows_px(self.verifier.window, proposals.boxes_px, proposals.depths_m, focal_px)
        prediction = VerifierPrediction.empty()
        if len(proposals):
            image = encode_channels(dense, calibration.image_P_velo, self._sensor.height_m)
            prediction = self.verifier.predict(image, windows)
        boxes_px = _within_image(prediction.boxes_px, dense.depth_m.shape)
        found = Detections(boxes_px, prediction.scores, prediction.types)
        return VerifiedProposals(proposals, windows, found, self._keep(found))

    def _keep(self, found: Detections) -> Int:
        """Return the rows of the detections: above the score threshold, in the image, and not suppressed."""
        is_in_image = (found.boxes_px[:, 2:] > found.boxes_px[:, :2]).all(axis=1)
        rows = np.flatnonzero(is_in_image & (found.scores >= self._min_score))
        return np.asarray(rows[suppress(found[rows], self._max_iou)])


def _within_image(boxes_px: Float64, shape: tuple[int, ...]) -> Float64:
    """Clip (M, 4) boxes to the centres of the outermost pixels, as in KITTI's labels."""
    height, width = shape
    return np.asarray(np.clip(boxes_px, 0, [width - 1, height - 1] * 2))
