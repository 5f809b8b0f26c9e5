"""The values that are tried of each rule, and all their combinations."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from itertools import product

from perception.detection.config import ProposalConfig
from perception.errors import UsageError


@dataclass(frozen=True)
class SearchGrid:
    """Values of each of the four parameters; the thesis does not state which it tried.

    Attributes:
        cell_m: Edges of a cell of the ground removal in metres.
        min_variance_m2: Minimum variances of the heights in a cell above the ground, in square metres.
        min_points: Minimum numbers of points within the radius of a core point (DBSCAN).
        radius_m: Radii of the neighbourhood in metres (DBSCAN).
    """

    cell_m: tuple[float, ...] = (0.3, 0.4, 0.5, 0.7)
    min_variance_m2: tuple[float, ...] = (0.0025, 0.005, 0.01, 0.02, 0.04)
    min_points: tuple[int, ...] = (1, 3, 5, 10)
    radius_m: tuple[float, ...] = (0.2, 0.3, 0.4, 0.5, 0.7)

    def __post_init__(self) -> None:
        """Validate that each parameter has values, each once, that can be used."""
        for name in (field.name for field in fields(self)):
            values = getattr(self, name)
            if not values or len(set(values)) < len(values):
                raise UsageError(
                    f"--grid.{name}", expected="values, each once", found=str(list(values))
                )
        self.combinations()

    def __len__(self) -> int:
        """Return how many settings there are."""
        return len(self.combinations())

    def combinations(self) -> list[ProposalConfig]:
        """Return every combination; those that share their ground removal lie together."""
        return [parameters for ground in self.grounds() for parameters in ground]

    def grounds(self) -> Iterator[list[ProposalConfig]]:
        """Yield the combinations that share their ground removal: one cell, one least variance."""
        for cell_m, variance_m2 in product(self.cell_m, self.min_variance_m2):
            yield [
                ProposalConfig(cell_m, variance_m2, points, radius_m)
                for points, radius_m in product(self.min_points, self.radius_m)
            ]
