"""How often the truth lies within the intervals of a reported covariance."""

import numpy as np
from scipy.stats import chi2

from perception.types import Float64

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
