"""What `trifuse detect` found, for people and for programs."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from perception.cli.vehicle_detector import VehicleDetectorOutput
from perception.evaluation.stage_times import median_frame_s, stage_table


@dataclass
class DetectSummary:
    """What was detected, added up frame by frame.

    Attributes:
        drive: its name.
        out: where the results are.
        shown_score: of what is counted as shown.
        seconds: by stage, one entry a frame.
        proposals: one entry a frame.
        detections: one entry a frame.
        shown: one entry a frame.
        elapsed_s: wall time with reading, drawing and writing.
    """

    drive: str
    out: Path
    shown_score: float
    seconds: dict[str, list[float]] = field(default_factory=dict)
    proposals: list[int] = field(default_factory=list)
    detections: list[int] = field(default_factory=list)
    shown: list[int] = field(default_factory=list)
    elapsed_s: float = 0.0

    def add(self, output: VehicleDetectorOutput) -> None:
        """Count one frame."""
        for stage, seconds in output.timings_s.items():
            self.seconds.setdefault(stage, []).append(seconds)
        self.proposals.append(len(output.proposals_px))
        self.detections.append(len(output.detections))
        self.shown.append(int((output.detections.scores >= self.shown_score).sum()))

    def table(self) -> str:
        """Return what is printed at the end."""
        frames = len(self.detections)
        if not frames:
            return f"{self.drive}: no frame was done"
        title = f"{self.drive}: {frames} frames"
        proposals, detections, shown = map(np.mean, (self.proposals, self.detections, self.shown))
        lines = [
            stage_table(title, self.seconds).text(),
            "",
            f"a frame: {proposals:.1f} proposals, {detections:.1f} written as vehicles, "
            f"{shown:.1f} of these with a score of {self.shown_score:g} or more; "
            f"{1 / median_frame_s(self.seconds):.0f} frames/s for the stages, "
            f"{frames / self.elapsed_s:.1f} with reading, drawing and writing",
            f"results: {self.out}",
        ]
        return "\n".join(lines)

    def to_json(self) -> dict[str, object]:
        """Return the same figures for summary.json."""
        return {
            "drive": self.drive,
            "frames": len(self.detections),
            "elapsed_s": round(self.elapsed_s, 3),
            "stages_ms": stage_table("", self.seconds).to_json(),
            "proposals": sum(self.proposals),
            "detections": sum(self.detections),
            "shown": {"min_score": self.shown_score, "detections": sum(self.shown)},
        }
