"""Summary of a detector over a drive: times of its stages, and counts of proposals and detections."""

from dataclasses import dataclass, field
from typing import Any

from perception.evaluation.detection.detector_measure import FrameDetections
from perception.evaluation.stage_times import median_frame_s, stage_table


@dataclass
class DetectorSummary:
    """Counts and times over the frames of a drive.

    Attributes:
        name: Name of the drive.
        display_score: Score from which a detection is counted as displayed.
        network: Metadata of the network.
        seconds: Time by stage, one entry a frame.
        counts: Number of proposals, detections and displayed detections, one entry a frame.
        elapsed_s: Wall time with reading, drawing and writing.
    """

    name: str
    display_score: float
    network: dict[str, str]
    seconds: dict[str, list[float]] = field(default_factory=dict)
    counts: list[tuple[int, int, int]] = field(default_factory=list)
    elapsed_s: float = 0.0

    def add(self, output: FrameDetections) -> None:
        """Add one frame."""
        for stage, seconds in output.timings_s.items():
            self.seconds.setdefault(stage, []).append(seconds)
        found, proposals = output.detections, output.proposals_px
        displayed = int((found.scores >= self.display_score).sum())
        self.counts.append((0 if proposals is None else len(proposals), len(found), displayed))

    def text(self) -> str:
        """Return the times of the stages and the counts."""
        frames = len(self.counts)
        if not frames:
            return f"{self.name}: no frame could be read"
        table = stage_table(f"{self.name}: {frames} frames", self.seconds).text()
        proposals, detections, displayed = (sum(one) / frames for one in self._columns())
        return (
            f"{table}\n\n{proposals:.1f} proposals/frame, {detections:.1f} detections/frame, {displayed:.1f} of "
            f"these with a score of {self.display_score:g} or more; {1 / median_frame_s(self.seconds):.0f} frames/s "
            f"for the stages, {frames / self.elapsed_s:.1f} with reading, drawing and writing"
        )

    def to_json(self) -> dict[str, Any]:
        """Return the same for summary.json."""
        proposals, detections, displayed = map(sum, self._columns())
        return {
            "drive": self.name,
            "frames": len(self.counts),
            "elapsed_s": round(self.elapsed_s, 3),
            "stages_ms": stage_table("", self.seconds).to_json(),
            "proposals": proposals,
            "detections": detections,
            "network": self.network,
            "displayed": {"display_score": self.display_score, "detections": displayed},
        }

    def _columns(self) -> list[tuple[int, ...]]:
        return list(zip(*self.counts, strict=True)) or [(), (), ()]
