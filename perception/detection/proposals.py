"""Candidates for vehicles: what stands on the ground, cut into clusters, boxed in the image (6.1.2)."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.errors import UsageError
from perception.types import Bool, Calibration, Float32, Float64, Int


@dataclass(frozen=True)
class ProposalRules:
    """The four parameters that the thesis searches for jointly (6.1.4); its values from the author's code.

    Attributes:
        cell_m: edge of a cell of the ground removal, the thesis' upsilon.
        least_variance_m2: a cell whose heights vary less is ground, delta.
        least_points: within the radius make a point a core of a cluster, eta.
        radius_m: of DBSCAN's neighbourhood, epsilon.
    """

    cell_m: float = 0.5
    least_variance_m2: float = 0.01
    least_points: int = 5
    radius_m: float = 0.5

    def __post_init__(self) -> None:
        """Refuse what cannot work."""
        if not (self.cell_m > 0 and self.radius_m > 0 and self.least_points > 0):
            found = f"{self.cell_m:g} m, {self.radius_m:g} m, {self.least_points}"
            raise UsageError(
                "rules of the proposals",
                expected="cell, radius and least points above zero",
                found=found,
            )


@dataclass(frozen=True)
class Proposals:
    """M candidates of one scan, and which of its points they are made of.

    Attributes:
        boxes_px: (M, 4) x1 y1 x2 y2 within the image.
        depths_m: (M,) along the optical axis, where the near side of the candidate is.
        clusters: (N,) for each point of the scan the candidate that it belongs to, or -1.
    """

    boxes_px: Float64
    depths_m: Float64
    clusters: Int

    def __len__(self) -> int:
        """Return M."""
        return len(self.boxes_px)

    def __getitem__(self, rows: Bool | Int) -> Self:
        """Return the candidates of a mask or of indices, numbered anew."""
        numbers = np.full(len(self) + 1, -1)
        kept = np.arange(len(self))[rows]
        numbers[kept] = np.arange(len(kept))
        return type(self)(self.boxes_px[rows], self.depths_m[rows], numbers[self.clusters])


def propose(
    points_velo: Float32,
    calibration: Calibration,
    size_px: tuple[int, int],
    rules: ProposalRules = ProposalRules(),
) -> Proposals:
    """Find the candidates of an (N, 4) scan in an image of (width, height)."""
    raise NotImplementedError
