"""What several commands ask of a flag's value."""

from perception.errors import UsageError


def require_positive(flag: str, count: int | None) -> None:
    """Refuse a count below one; None is no count, and so no limit.

    Raises:
        UsageError: it is below one.
    """
    if count is not None and count < 1:
        raise UsageError(flag, expected="at least 1", found=str(count))
