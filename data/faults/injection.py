"""Faults put into the frames of a drive."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Self

from data.faults.kinds import FAULT_KINDS, FaultKind
from data.faults.moment import FaultMoment
from perception.errors import UsageError
from perception.types import Frame

_FORM = (
    "KIND:FIRST-LAST or KIND:FIRST-LAST:SIZE, such as camera-dark:50-80 or lidar-sector:20-40:90"
)


@dataclass(frozen=True)
class Fault:
    """One fault in a drive.

    Attributes:
        kind: Name of the kind (`FAULT_KINDS`).
        first: Index of its first frame.
        last: Index of its last frame.
        size: Size, in the unit of the kind; None for the kind's default.
        seed: Seed.
    """

    kind: str
    first: int
    last: int
    size: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        """Validate kind and frames."""
        if self.kind not in FAULT_KINDS:
            raise UsageError(
                "--fault", expected=f"one of {', '.join(FAULT_KINDS)}", found=self.kind
            )
        if not 0 <= self.first <= self.last:
            found = f"{self.first}-{self.last}"
            raise UsageError("--fault", expected="a first frame not after the last", found=found)

    @classmethod
    def parse(cls, text: str, seed: int = 0) -> Self:
        """Return the fault that a text describes.

        Args:
            text: `KIND:FIRST-LAST` or `KIND:FIRST-LAST:SIZE`.
            seed: Seed.

        Raises:
            UsageError: It has another form, or names no kind of fault.
        """
        kind, _, rest = text.partition(":")
        frames, _, size = rest.partition(":")
        first, _, last = frames.partition("-")
        try:
            numbers = int(first), int(last), float(size) if size else None
        except ValueError as error:
            raise UsageError("--fault", expected=_FORM, found=repr(text)) from error
        return cls(kind, *numbers, seed)

    @property
    def definition(self) -> FaultKind:
        """Kind of the fault."""
        return FAULT_KINDS[self.kind]

    def apply(self, frame: Frame, before: Frame, start: Frame) -> Frame:
        """Return a frame of the fault.

        Args:
            frame: Frame as the sensors gave it, or as other faults left it.
            before: Frame before it.
            start: Last frame before the fault.
        """
        moment = FaultMoment(frame, before, start, frame.index - self.first, self.seed)
        return self.definition.make(
            moment, self.definition.default if self.size is None else self.size
        )


def inject(frames: Iterable[Frame], faults: Sequence[Fault]) -> Iterator[Frame]:
    """Yield the frames of a drive with the faults, one after another where they meet."""
    starts: dict[Fault, Frame] = {}
    before: Frame | None = None
    for clean in frames:
        frame = clean
        for fault in faults:
            if fault.first <= clean.index <= fault.last:
                start = starts.setdefault(fault, before or clean)
                frame = fault.apply(frame, before or clean, start)
        before = clean
        yield frame
