"""Frame rates of the studies: recorded drives at a lower one, by every n-th frame with its stamp and its pose."""

from perception.errors import UsageError
from perception.types import Drive


def frame_step(drive: Drive, rate_hz: float | None) -> int:
    """Return the step from one frame of a drive to the next at a frame rate; 1 without a rate.

    Raises:
        UsageError: The drive has fewer frames a second.
    """
    if rate_hz is None:
        return 1
    from data.frames import frame_period_s

    own_hz = 1 / frame_period_s(drive)
    step = round(own_hz / rate_hz)
    if step < 1:
        raise UsageError(
            "--rates",
            expected=f"at most {own_hz:.0f} Hz, as {drive.name} has",
            found=f"{rate_hz:g}",
        )
    return step
