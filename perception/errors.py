"""Errors that a user can cause.

Libraries raise them; the command line prints one as a sentence and exits with code 2.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


class PerceptionError(Exception):
    """An error in one sentence: where it is, what was expected, what was found, and what to do."""

    def __init__(
        self, where: str | Path, *, expected: str, found: str, advice: str | None = None
    ) -> None:
        """Compose the sentence.

        Args:
            where: File, argument or frame of the fault.
            expected: Content or value that is valid there.
            found: Content or value that is there instead.
            advice: Remedy for the user, as an imperative.
        """
        self.where, self.expected, self.found, self.advice = str(where), expected, found, advice
        sentence = f"{where}: expected {expected}, found {found}"
        # No full stop: an advice often ends with a command, which is copied.
        sentence = f"{sentence}; {advice}" if advice else sentence
        # Names from a file may hold line breaks, or codes that a terminal obeys.
        super().__init__("".join(one if one.isprintable() else " " for one in sentence))

    def __reduce__(self) -> tuple[Any, ...]:
        """Keep all fields when the error is sent from a worker process."""
        return _restore, (type(self), self.args, self.__dict__)


def _restore(
    kind: type[PerceptionError], args: tuple[Any, ...], fields: dict[str, Any]
) -> PerceptionError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(fields)
    return error


class ScanError(PerceptionError):
    """A LiDAR scan is truncated, empty, not finite, or not in its format."""


class MountingError(PerceptionError):
    """The LiDAR is not mounted as its axes and its model state."""


class ImageError(PerceptionError):
    """A camera image is unreadable or of another size than its calibration."""


class CalibrationError(PerceptionError):
    """A calibration lacks a key, or holds a matrix that cannot be used."""


class PoseError(PerceptionError):
    """A pose is missing, malformed, or jumps."""


class LabelError(PerceptionError):
    """A label row cannot be read."""


class DriveError(PerceptionError):
    """A drive folder has another layout, or lacks a file that a stage needs."""


class ModelError(PerceptionError):
    """A model file or checkpoint is unreadable, or for other inputs or classes."""


class WriteError(PerceptionError):
    """A file cannot be written: the disk is full, or the place is not writable."""


class UsageError(PerceptionError):
    """An option has a value that cannot work."""


class MissingDependencyError(PerceptionError):
    """An optional package is not installed."""

    def __init__(self, package: str, *, needed_for: str, extra: str, reason: ImportError) -> None:
        """Compose the sentence with the line that installs the package."""
        super().__init__(
            needed_for,
            expected=f"the Python package {package}",
            found=str(reason),
            advice=f"install it with: {pip_command(extra)}",
        )


@contextmanager
def optional_package(package: str, *, needed_for: str, extra: str) -> Iterator[None]:
    """Import an optional package in a `with`, and state how it is installed where it is missing.

    Args:
        package: Name of the package, as pip knows it.
        needed_for: Flag, file or method that needs it.
        extra: Extra of this program that installs it.

    Raises:
        MissingDependencyError: It is not installed.
    """
    try:
        yield
    except ImportError as error:
        raise MissingDependencyError(
            package, needed_for=needed_for, extra=extra, reason=error
        ) from error


def pip_command(extra: str) -> str:
    """Return the command that adds an extra to this installation: a source tree, a wheel file, or a release."""
    root = Path(__file__).parents[1]
    if (root / "pyproject.toml").is_file():
        return f'pip install --editable "{root}[{extra}]"'
    origin = f" @ {url}" if (url := _wheel_url()) else ""
    return f'pip install "trifuse[{extra}]{origin}"'


def _wheel_url() -> str | None:
    """Return where pip has the package from, unless it was asked for by name."""
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        record = distribution("trifuse").read_text("direct_url.json")
    except PackageNotFoundError:
        return None
    url: str | None = json.loads(record)["url"] if record else None
    return url
