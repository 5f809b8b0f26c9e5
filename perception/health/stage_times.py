"""Monitor of the stages: frames beyond the time budget, and stages that were left out to keep it."""

from collections.abc import Sequence

from perception.types import HealthFinding, HealthLevel, StageSpan

_ERROR_FRAMES = 5  # in a row
OVER_BUDGET, LEFT_OUT = "over the time budget", "left out"


class StageTimeMonitor:
    """Names the stage that takes most of a late frame, and stages that are left out; an ERROR from five frames on."""

    def __init__(self, budget_s: float | None) -> None:
        """Start without a frame.

        Args:
            budget_s: Time from the arrival of a frame to its result in seconds; None for no limit.
        """
        self._budget_s = budget_s
        self._lasts: dict[str, int] = {}

    def update(self, spans: Sequence[StageSpan], skipped: Sequence[str]) -> list[HealthFinding]:
        """Return the findings of a frame.

        Args:
            spans: Start and end of each stage since the arrival of the frame.
            skipped: Stages that were left out.
        """
        if self._budget_s is None:
            return []
        budget_ms = 1e3 * self._budget_s
        found: dict[str, tuple[str, str]] = {
            f"{stage} {LEFT_OUT}": (stage, f"the budget of {budget_ms:.0f} ms would not be kept")
            for stage in skipped
        }
        late_ms = 1e3 * max((span.stop_s for span in spans), default=0.0)
        if late_ms > budget_ms:
            longest = max(spans, key=lambda span: span.stop_s - span.start_s)
            longest_ms = 1e3 * (longest.stop_s - longest.start_s)
            found[OVER_BUDGET] = (
                longest.stage,
                f"the result came {late_ms:.0f} ms after the frame, the budget is {budget_ms:.0f} ms; "
                f"this stage took most, {longest_ms:.0f} ms",
            )
        self._lasts = {fault: self._lasts.get(fault, 0) + 1 for fault in found}
        return [
            HealthFinding(
                stage,
                self._level(fault),
                f"{stage} {OVER_BUDGET}" if fault == OVER_BUDGET else fault,
                reason,
            )
            for fault, (stage, reason) in found.items()
        ]

    def _level(self, fault: str) -> HealthLevel:
        is_error = self._lasts[fault] >= _ERROR_FRAMES
        return HealthLevel.ERROR if is_error else HealthLevel.WARN
