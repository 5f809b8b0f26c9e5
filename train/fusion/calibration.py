"""The curves that make probabilities of scores, fitted to detections that are known to be right or wrong."""

from collections.abc import Mapping

import numpy as np
from scipy.optimize import minimize

from perception.detection.fusion.score_calibration import BetaCalibration, score_logs
from perception.evaluation.detection.reliability import Correctness
from perception.types import Float64

_MIN_SLOPE = 1e-3  # so that the order of the scores is kept


def fit_calibration(found: Correctness) -> BetaCalibration:
    """Return the beta calibration of the greatest likelihood; where all are alike, scores stay as they are."""
    return fit_class_calibrations({"": found})[""]


def fit_class_calibrations(found: Mapping[str, Correctness]) -> dict[str, BetaCalibration]:
    """Return the beta calibrations of classes, which differ by their offsets alone, so that rare classes have one.

    Their logits are linear in the parameters, and so the likelihood has one summit. Within the bounds of the slopes
    this is scikit-learn's `LogisticRegression` on the logarithms, which knows no bounds: a curve that falls would turn
    the order of the scores. Offsets have a prior: those of two classes differ by a standard deviation of 1.

    Args:
        found: Scores of each class, and which are correct.
    """
    right = np.concatenate([one.is_correct for one in found.values()]).astype(np.float64)
    if not 0 < right.sum() < len(right):
        return dict.fromkeys(found, BetaCalibration())
    classes = np.repeat(np.eye(len(found)), [len(one.scores) for one in found.values()], axis=0)
    logs = score_logs(np.concatenate([one.scores for one in found.values()]))
    columns = np.column_stack([*logs, classes])

    def loss(parameters: Float64) -> tuple[float, Float64]:
        logits = columns @ parameters
        # ln (1 + exp x) - y x, without an overflow.
        entropy = float(np.sum(np.logaddexp(0, logits) - right * logits))
        differences = parameters[2:] - parameters[2:].mean()
        gradient = columns.T @ (1 / (1 + np.exp(-logits)) - right)
        gradient[2:] += differences
        return (entropy + float(differences @ differences) / 2) / len(right), gradient / len(right)

    start = [1.0, 1.0, *[0.0] * len(found)]
    bounds = [(_MIN_SLOPE, None)] * 2 + [(None, None)] * len(found)
    a, b, *offsets = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds).x.tolist()
    return {name: BetaCalibration(a, b, c) for name, c in zip(found, offsets, strict=True)}
