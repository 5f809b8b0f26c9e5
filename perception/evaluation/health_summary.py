"""Health over a drive: how many frames each fault lasted."""

from dataclasses import dataclass, field, replace

from perception.types import Health, HealthLevel


@dataclass(frozen=True)
class FaultSummary:
    """One fault over a drive.

    Attributes:
        part: Sensor or stage.
        level: Worst level.
        frames: Number of frames with it.
        first: Index of its first frame.
        reason: What was found in its first frame.
    """

    part: str
    level: HealthLevel
    frames: int
    first: int
    reason: str


@dataclass
class HealthSummary:
    """Faults of a drive, added frame by frame.

    Attributes:
        frames: Number of frames.
        healthy: Number of frames without a finding.
        faults: Faults by name.
    """

    frames: int = 0
    healthy: int = 0
    faults: dict[str, FaultSummary] = field(default_factory=dict)

    def update(self, frame: int, health: Health) -> None:
        """Add the health of a frame by its index."""
        self.frames += 1
        self.healthy += not health.findings
        for one in health.findings:
            new = FaultSummary(one.part, one.level, 0, frame, one.reason)
            known = self.faults.get(one.fault, new)
            level = max(known.level, one.level)
            self.faults[one.fault] = replace(known, frames=known.frames + 1, level=level)

    def text(self) -> str:
        """Return one line."""
        if not self.faults:
            return f"health: OK in all {self.frames} frames"
        by_frames = sorted(self.faults.items(), key=lambda item: -item[1].frames)
        faults = [
            f"{name} in {one.frames} from frame {one.first} on ({one.level.name})"
            for name, one in by_frames
        ]
        return f"health: OK in {self.healthy} of {self.frames} frames; {', '.join(faults)}"

    def to_json(self) -> dict[str, object]:
        """Return the numbers and the faults by name."""
        faults = {name: {**vars(one), "level": one.level.name} for name, one in self.faults.items()}
        return {"frames": self.frames, "healthy": self.healthy, "faults": faults}
