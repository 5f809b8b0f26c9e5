"""How often the truth lies within the intervals of a reported covariance."""

from collections.abc import Mapping
from typing import TypeVar

import numpy as np
from scipy.stats import chi2

from perception.types import ArrayTable, Bool, Float64

Errors = TypeVar("Errors", bound=ArrayTable)

# Share of the errors that the interval should hold.
LEVEL = 0.9


def squared_mahalanobis(errors: Float64, covariances: Float64) -> Float64:
    """Return the (N,) squared Mahalanobis distances of (N, k) errors by (N, k, k) covariances; NaN without one.

    Of a true covariance and normal errors they are chi-squared with k degrees of freedom.
    """
    spread = np.full(len(errors), np.nan)
    known = np.isfinite(covariances).all(axis=(1, 2)) & np.isfinite(errors).all(axis=1)
    weighted = np.linalg.solve(covariances[known], errors[known][..., None])[..., 0]
    spread[known] = (errors[known] * weighted).sum(axis=1)
    return spread


def interval_coverage(squared_distances: Float64, dimensions: int, level: float = LEVEL) -> float:
    """Return the share of known squared Mahalanobis distances within the interval of a level; NaN without any."""
    known = squared_distances[np.isfinite(squared_distances)]
    return float((known <= chi2.ppf(level, dimensions)).mean()) if len(known) else float("nan")


def groups(errors: Errors, rows: Mapping[str, Bool]) -> dict[str, Errors]:
    """Return the errors of each group that has any.

    Args:
        errors: (N) Errors.
        rows: (N,) Rows of each group, by its name.
    """
    return {name: errors[one] for name, one in rows.items() if one.any()}
