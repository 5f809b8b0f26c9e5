"""DepthCN: all proposals of a frame at once, and one after the other."""

from functools import partial

import numpy as np

from benchmarks.measure import Comparison, Contender, Measurement, add_peer, compare, metric
from benchmarks.reference.depthcn import detect_one_by_one
from benchmarks.stages import PreparedDrive
from data.detections.measured_detectors import run_depthcn
from perception.detection.depthcn.detector import DepthCn
from perception.evaluation.report import Column

_TRIFUSE = "Trifuse"


def compare_depthcn(prepared: PreparedDrive) -> Comparison:
    """Detect from scan to boxes; the reference implementation calls the same network for each proposal.

    Raises:
        ModelError: The network does not ship with this copy.
    """
    sensor, frames = prepared.drive.sensor, prepared.frames
    detector = DepthCn("default", sensor)

    def thesis() -> Contender:
        network = DepthCn("thesis", sensor)
        return Contender("the thesis' network", lambda i: network.detect(frames[i]))

    contenders = [
        Contender(_TRIFUSE, lambda i: detector.detect(frames[i])),
        Contender(
            "reference: one proposal at a time",
            lambda i: detect_one_by_one(detector.verifier, frames[i], sensor),
        ),
    ]
    add_peer(contenders, thesis)
    detections = metric("detections", lambda outputs: float(np.mean([*map(len, outputs)])), ".1f")
    timings_s = [run_depthcn(detector, frame)[0].timings_s for frame in frames]
    stages = [
        Column(
            f"{stage} [ms]", partial(_median_ms, [one[stage] for one in timings_s]), ".1f", stage
        )
        for stage in timings_s[0]
    ]
    title = "DepthCN, from scan to boxes"
    return compare(title, contenders, len(frames), detections, *stages)


def _median_ms(seconds: list[float], row: Measurement) -> float | None:
    """Return the median time of a stage, which is measured of Trifuse alone."""
    return 1e3 * float(np.median(seconds)) if row.name == _TRIFUSE else None
