"""The curve that makes probabilities of scores, fitted to detections that are known to be right or wrong."""

import numpy as np
from scipy.optimize import minimize

from perception.detection.fusion.score_calibration import BetaCalibration, score_logs
from perception.evaluation.detection.reliability import Correctness
from perception.types import Float64

_MIN_SLOPE = 1e-3  # so that the order of the scores is kept


def fit_calibration(found: Correctness) -> BetaCalibration:
    """Return the beta calibration of the greatest likelihood; where all are alike, scores stay as they are.

    Its logit is linear in the parameters, and so the likelihood has one summit. Within the bounds of the slopes this is
    scikit-learn's `LogisticRegression` on the logarithms, which knows no bounds: a curve that falls would turn the
    order of the scores.
    """
    right = found.is_correct.astype(np.float64)
    if not 0 < right.sum() < len(right):
        return BetaCalibration()
    columns = np.stack([*score_logs(found.scores), np.ones(len(right))], axis=1)

    def loss(parameters: Float64) -> tuple[float, Float64]:
        logits = columns @ parameters
        # ln (1 + exp x) - y x, without an overflow.
        value = float(np.mean(np.logaddexp(0, logits) - right * logits))
        return value, columns.T @ (1 / (1 + np.exp(-logits)) - right) / len(right)

    bounds = [(_MIN_SLOPE, None), (_MIN_SLOPE, None), (None, None)]
    fitted = minimize(loss, [1.0, 1.0, 0.0], jac=True, method="L-BFGS-B", bounds=bounds)
    a, b, c = (float(value) for value in fitted.x)
    return BetaCalibration(a, b, c)
