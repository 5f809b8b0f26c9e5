"""Calibration of scores: by known curves, and beside scikit-learn."""

import numpy as np
import pytest
from sklearn.calibration import calibration_curve
from sklearn.linear_model import LogisticRegression

from perception.detection.fusion.score_calibration import BetaCalibration, score_logs
from perception.errors import UsageError
from perception.evaluation.detection.reliability import Correctness, measure_reliability
from train.fusion.calibration import fit_calibration, fit_class_calibrations


def made_by(curve: BetaCalibration, count: int) -> Correctness:
    rng = np.random.default_rng(0)
    scores = rng.uniform(0, 1, count)
    return Correctness(scores, rng.uniform(size=count) < curve.probabilities(scores))


def test_a_calibration_finds_the_curve_that_made_the_scores():
    found = made_by(BetaCalibration(0.6, 1.8, -0.4), 60_000)
    curve = fit_calibration(found)
    np.testing.assert_allclose([curve.a, curve.b, curve.c], [0.6, 1.8, -0.4], atol=0.06)
    before = measure_reliability(found).expected_calibration_error
    after = measure_reliability(Correctness(curve.probabilities(found.scores), found.is_correct))
    assert after.expected_calibration_error < 0.01 < before


def test_within_its_bounds_it_is_a_logistic_regression():
    found = made_by(BetaCalibration(0.6, 1.8, -0.4), 2_000)
    curve = fit_calibration(found)
    theirs = LogisticRegression(C=np.inf, tol=1e-8)
    theirs.fit(np.stack(score_logs(found.scores), axis=1), found.is_correct)
    expected = [*theirs.coef_[0], theirs.intercept_[0]]
    np.testing.assert_allclose([curve.a, curve.b, curve.c], expected, atol=1e-3)


def test_curves_of_classes_differ_by_their_offsets():
    curves = {"Car": BetaCalibration(0.6, 1.8, -0.4), "Van": BetaCalibration(0.6, 1.8, 0.8)}
    found = fit_class_calibrations({name: made_by(one, 40_000) for name, one in curves.items()})
    for name, curve in curves.items():
        fitted = [found[name].a, found[name].b, found[name].c]
        np.testing.assert_allclose(fitted, [curve.a, curve.b, curve.c], atol=0.1)


def test_a_class_without_correct_detections_has_low_probabilities():
    rare = Correctness(np.array([0.5, 0.7]), np.zeros(2, bool))
    cars = made_by(BetaCalibration(), 1_000)
    found = fit_class_calibrations({"Car": cars, "Truck": rare})
    assert -2 < found["Truck"].c < found["Car"].c - 0.3


def test_where_all_are_right_scores_stay():
    assert fit_calibration(Correctness(np.array([0.2, 0.9]), np.ones(2, bool))) == BetaCalibration()


def test_a_calibration_keeps_the_order_whatever_it_is_shown():
    scores = np.linspace(0.01, 0.99, 200)
    curve = fit_calibration(Correctness(scores, scores < 0.5))  # the surer, the wronger
    assert (np.diff(curve.probabilities(scores)) > 0).all()
    with pytest.raises(UsageError) as raised:
        BetaCalibration(-1.0, 1.0, 0.0)
    assert (raised.value.where, raised.value.found) == ("calibration", "-1.0,1.0,0.0")


def test_reliability_is_the_calibration_curve_of_scikit_learn():
    found = made_by(BetaCalibration(0.6, 1.8, -0.4), 500)
    ours = measure_reliability(found)
    shares, scores = calibration_curve(found.is_correct, found.scores, n_bins=15)
    np.testing.assert_allclose(ours.shares, shares)
    np.testing.assert_allclose(ours.scores, scores)
    assert ours.counts.sum() == 500
