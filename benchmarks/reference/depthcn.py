"""Reference implementation of DepthCN: one proposal at a time, and suppression in a loop."""

import numpy as np

from benchmarks.reference.overlap import area, iou
from perception.detection.config import DEFAULT_NMS, NmsConfig
from perception.detection.depthcn.crops import windows_px
from perception.detection.depthcn.detector import MIN_SIZE_M
from perception.detection.depthcn.image import encode_channels
from perception.detection.depthcn.proposals import propose
from perception.detection.depthcn.verifier import Verifier, VerifierPrediction
from perception.maps.densify import densify
from perception.maps.projection import camera_of, project_frame
from perception.sensor import HDL_64E, LidarModel
from perception.types import Detections, Float64, Frame, UInt8


def detect_one_by_one(
    verifier: Verifier, frame: Frame, sensor: LidarModel = HDL_64E, nms: NmsConfig = DEFAULT_NMS
) -> Detections:
    """Detect as `DepthCn` does, with a call of the network for each proposal."""
    calibration, size_px = camera_of(frame)
    focal_px = float(calibration.image_P_cam[0, 0])
    proposals = propose(frame.points_velo, calibration, size_px)
    proposals = proposals[proposals.has_min_size(MIN_SIZE_M, focal_px)]
    image = encode_channels(
        densify(project_frame(frame)), calibration.image_P_velo, sensor.height_m
    )
    windows = windows_px(verifier.window, proposals.boxes_px, proposals.depths_m, focal_px)
    verified = verify_one_by_one(verifier, image, windows)
    right, bottom = size_px[0] - 1, size_px[1] - 1
    boxes_px = np.clip(verified.boxes_px, 0, [right, bottom, right, bottom])
    kept = [
        row
        for row in suppress_by_loop(boxes_px, verified.scores, nms.max_iou)
        if verified.scores[row] >= nms.min_score and area(boxes_px[row].tolist()) > 0
    ]
    return Detections(boxes_px[kept], verified.scores[kept], verified.types[kept])


def verify_one_by_one(verifier: Verifier, image: UInt8, windows: Float64) -> VerifierPrediction:
    """Classify (M, 4) windows of an image with a call of the network for each."""
    verified = [verifier.predict(image, window[None]) for window in windows]
    return VerifierPrediction(
        np.concatenate([np.zeros(0), *(one.scores for one in verified)]),
        np.concatenate([np.zeros((0, 4)), *(one.boxes_px for one in verified)]),
        np.concatenate([np.zeros(0, np.str_), *(one.types for one in verified)]),
    )


def suppress_by_loop(boxes_px: Float64, scores: Float64, max_iou: float) -> list[int]:
    """Return the rows that stay, best first, comparing each with each that stays."""
    kept: list[int] = []
    boxes = boxes_px.tolist()
    for row in sorted(range(len(scores)), key=lambda row: -scores[row]):
        if all(iou(boxes[row], boxes[other]) <= max_iou for other in kept):
            kept.append(row)
    return kept
