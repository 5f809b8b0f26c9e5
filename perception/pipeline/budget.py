"""The time budget of a frame: where it would be late, stages are left out that others do without."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

from perception.pipeline.workers import StageClock

Stage = TypeVar("Stage", bound=str)
# Weight of the newest frame in the typical time.
_NEWEST = 0.3
# Share of the typical time that remains where stages are left out, so that one slow frame does not stop them for good.
_REMAINS = 0.9


class TimeBudget:
    """Decides which stages a frame skips to be in time, by the times of earlier frames."""

    def __init__(self, budget_s: float | None) -> None:
        """Start without earlier frames.

        Args:
            budget_s: Time from the arrival of a frame to its result in seconds; None without a limit.
        """
        self._budget_s = budget_s
        # From the decision to the result, by what was left out.
        self._typical_s: dict[str, float] = {}

    def stages_to_skip(self, order: Sequence[Stage], clock: StageClock) -> tuple[Stage, ...]:
        """Return the stages to leave out: as few as keep the budget, all where even these do not suffice.

        Args:
            order: Stages that may be left out, the first of them first.
            clock: Clock of the frame.
        """
        for count in range(len(order)):
            name = _name(order[:count])
            typical_s = self._typical_s.get(name, 0.0)
            if self._budget_s is None or clock.elapsed_s + typical_s <= self._budget_s:
                return tuple(order[:count])
            self._typical_s[name] = _REMAINS * typical_s
        return tuple(order)

    @contextmanager
    def measured(self, skipped: Sequence[str], clock: StageClock) -> Iterator[None]:
        """Measure the rest of a frame that skips some stages, waiting for others included."""
        name, start_s = _name(skipped), clock.elapsed_s
        yield
        taken_s = clock.elapsed_s - start_s
        typical_s = self._typical_s.get(name, taken_s)
        self._typical_s[name] = typical_s + _NEWEST * (taken_s - typical_s)


def _name(skipped: Sequence[str]) -> str:
    """Return the name by which the times of frames without some stages are kept."""
    return ", ".join(skipped)
