"""What several commands ask of a flag's value."""

from collections.abc import Sequence
from pathlib import Path

from perception.errors import UsageError


def require_positive(flag: str, count: int | None) -> None:
    """Refuse a count below one; None is no count, and so no limit.

    Raises:
        UsageError: it is below one.
    """
    if count is not None and count < 1:
        raise UsageError(flag, expected="at least 1", found=str(count))


def require_drives(drives: Sequence[Path]) -> None:
    """Refuse to work on no drive.

    Raises:
        UsageError: there is none.
    """
    if not drives:
        raise UsageError("drives", expected="at least one", found="none")
