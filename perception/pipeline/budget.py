"""The time budget of a frame: a stage that nothing needs is left out where the frame would be late."""

from collections.abc import Iterator
from contextlib import contextmanager

from perception.pipeline.workers import StageClock

# Weight of the newest frame in the typical time of a stage.
_NEWEST = 0.3
# Share of the typical time that remains when a stage is left out, so that one slow frame does not stop it for good.
_REMAINS = 0.9


class TimeBudget:
    """Decides whether a frame would still be in time with a stage, by the times of earlier frames."""

    def __init__(self, budget_s: float | None) -> None:
        """Start without earlier frames.

        Args:
            budget_s: Time from the arrival of a frame to its result in seconds; None without a limit.
        """
        self._budget_s = budget_s
        self._typical_s: dict[str, float] = {}

    def allows(self, stage: str, clock: StageClock, *following: str) -> bool:
        """Return whether a stage and those that follow it are expected to end in time.

        Args:
            stage: Stage that is about to run.
            clock: Clock of the frame.
            *following: Stages that run in any case.
        """
        typical_s = [self._typical_s.get(name, 0.0) for name in (stage, *following)]
        if self._budget_s is None or clock.elapsed_s + sum(typical_s) <= self._budget_s:
            return True
        self._typical_s[stage] = _REMAINS * typical_s[0]
        return False

    @contextmanager
    def measured(self, stage: str, clock: StageClock) -> Iterator[None]:
        """Measure the time of a stage, waiting for others included."""
        start_s = clock.elapsed_s
        yield
        taken_s = clock.elapsed_s - start_s
        typical_s = self._typical_s.get(stage, taken_s)
        self._typical_s[stage] = typical_s + _NEWEST * (taken_s - typical_s)
