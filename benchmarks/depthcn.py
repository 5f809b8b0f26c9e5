"""DepthCN: all proposals of a frame at once, and one after the other."""

from collections import defaultdict
from typing import Any

import numpy as np

from benchmarks.measure import Cell, Contender, time_interleaved
from benchmarks.reference.depthcn import detect_one_by_one
from benchmarks.stages import Comparison, PreparedDrive, add_peer
from data.detections.measured_detectors import run_depthcn
from perception.detection.depthcn.detector import DepthCn


def compare_depthcn(prepared: PreparedDrive) -> Comparison:
    """Detect from scan to boxes; the reference implementation calls the same network for each proposal.

    Raises:
        ModelError: The network does not ship with this copy.
    """
    sensor, frames = prepared.drive.sensor, prepared.frames
    ours = DepthCn("default", sensor)

    def thesis() -> Contender:
        network = DepthCn("thesis", sensor)
        return Contender("the thesis' network", lambda i: network.detect(frames[i]))

    contenders = [
        Contender("Trifuse", lambda i: ours.detect(frames[i])),
        Contender(
            "reference: one proposal at a time",
            lambda i: detect_one_by_one(ours.verifier, frames[i], sensor),
        ),
    ]
    add_peer(contenders, thesis)
    found: dict[str, list[int]] = defaultdict(list)

    def count(name: str, i: int, detections: Any) -> None:  # noqa: ANN401 - of each contender
        found[name].append(len(detections))

    timings = time_interleaved(contenders, len(frames), count)
    metrics: dict[str, dict[str, Cell]] = {
        "detections": {name: f"{np.mean(counts):.1f}" for name, counts in found.items()}
    }
    for stage, milliseconds in _parts_ms(prepared).items():
        metrics[f"{stage} [ms]"] = {"Trifuse": f"{milliseconds:.1f}"}
    return Comparison("DepthCN, from scan to boxes", timings, metrics)


def _parts_ms(prepared: PreparedDrive) -> dict[str, float]:
    """Return the median time of each part of the detector."""
    detector = DepthCn("default", prepared.drive.sensor)
    seconds: dict[str, list[float]] = defaultdict(list)
    for frame in prepared.frames:
        for stage, spent_s in run_depthcn(detector, frame)[0].timings_s.items():
            seconds[stage].append(spent_s)
    return {stage: 1e3 * float(np.median(spent)) for stage, spent in seconds.items()}
