"""Evidence that tracks are objects, and of which class: sums of log-odds over frames."""

import numpy as np
from numpy.typing import NDArray

from perception.tracking.vehicles.config import EvidenceConfig
from perception.types import Float64

# Beyond these, a single detection would settle a track for good.
_MIN_PROBABILITY, _MAX_PROBABILITY = 0.02, 0.98


def detection_evidence(existence: Float64, config: EvidenceConfig) -> Float64:
    """Return (D,) the evidence of detections that an object is there; 0 at the prior."""
    return _log_odds(existence) - float(_log_odds(np.array(config.prior)))


def probability(evidence: Float64) -> Float64:
    """Return the probability of evidence."""
    return np.asarray(1.0 / (1.0 + np.exp(-evidence)))


def class_evidence(
    types: NDArray[np.str_], existence: Float64, classes: NDArray[np.str_]
) -> Float64:
    """Return (D, C) the evidence of detections for each class."""
    return np.where(types[:, None] == classes, existence[:, None], 0.0)


def _log_odds(probabilities: Float64) -> Float64:
    inside = np.clip(probabilities, _MIN_PROBABILITY, _MAX_PROBABILITY)
    return np.asarray(np.log(inside / (1.0 - inside)))
