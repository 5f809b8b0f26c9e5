"""How strong the operations are by which samples are changed."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import ClassVar, Self

from perception.errors import UsageError


@dataclass(frozen=True)
class AugmentationConfig:
    """A number for each operation, 0 is off; subclasses name the operations.

    Attributes:
        MAX: the strongest that makes sense, 10 for those that are not named.
    """

    MAX: ClassVar[Mapping[str, float]] = {}

    def __post_init__(self) -> None:
        """Refuse strengths below zero, and those that leave nothing of a sample."""
        for name, magnitude in asdict(self).items():
            most = self.MAX.get(name, 10.0)
            if not 0 <= magnitude <= most:
                raise UsageError(
                    f"augmentation {name}",
                    expected=f"a strength from 0 to {most:g}",
                    found=f"{magnitude:g}",
                )

    @classmethod
    def none(cls) -> Self:
        """Change nothing."""
        return cls(*[0.0] * len(fields(cls)))

    def only(self, operation: str) -> Self:
        """Return this one operation, as strong as it is here."""
        return replace(self.none(), **{operation: getattr(self, operation)})
