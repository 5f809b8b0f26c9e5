"""Assertions on the fields of errors: where a fault is, what was expected, what was found."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from perception.cli.main import run_command_line
from perception.errors import PerceptionError


@contextmanager
def fault(
    kind: type[PerceptionError],
    where: str = "",
    expected: str = "",
    found: str = "",
    advice: str = "",
) -> Iterator[None]:
    """Expect an error whose fields contain these words."""
    with pytest.raises(kind) as raised:
        yield
    error = raised.value
    assert type(error) is kind
    for name, words in (
        ("where", where), ("expected", expected), ("found", found), ("advice", advice),
    ):  # fmt: skip
        assert words in (getattr(error, name) or ""), f"{name}: {getattr(error, name)}"


def command(*words: object) -> None:
    """Run a command as `trifuse` does, but raise its error instead of printing it."""
    run_command_line([str(word) for word in words])
