"""Steps downhill beside SciPy's, and what they do where a loss is bent away or not a number."""

import numpy as np
import pytest
from scipy.optimize import minimize, rosen, rosen_der

from perception.calibration.edge_alignment import minimize_loss


def test_it_ends_where_scipy_does():
    rng = np.random.default_rng(0)
    root, bend, start = rng.normal(size=(4, 4)), rng.normal(size=4), rng.normal(size=4)
    curvature = root @ root.T + np.eye(4)

    def loss(place):
        value = place @ curvature @ place / 2 + np.log(np.cosh(place - bend)).sum()
        return value, curvature @ place + np.tanh(place - bend)

    found = minimize_loss(loss, start, np.eye(4), 1e-12)
    expected = minimize(loss, start, jac=True, method="BFGS", options={"gtol": 1e-10}).x
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_a_narrow_bent_valley_is_followed_to_its_end():
    found = minimize_loss(
        lambda place: (float(rosen(place)), rosen_der(place)),
        np.array([-1.2, 1.0]),
        np.eye(2) / 800,
        0.0,
    )
    np.testing.assert_allclose(found, [1, 1], atol=1e-6)


def test_a_known_curvature_leads_there_in_one_step():
    curvature, calls = np.array([[40.0, 19.0], [19.0, 11.0]]), []

    def loss(place):
        calls.append(place)
        return float(place @ curvature @ place) / 2, curvature @ place

    found = minimize_loss(loss, np.array([3.0, -2.0]), np.linalg.inv(curvature), 1e-9)
    np.testing.assert_allclose(found, 0, atol=1e-12)
    assert len(calls) == 3  # at the start, there, and where a further step gains nothing


@pytest.mark.parametrize("start", [0.9, 1.0], ids=["within", "at its border"])
def test_no_step_leads_to_where_the_loss_is_not_a_number(start):
    def loss(place):
        inside = abs(place[0]) <= 1
        return (float(-place[0]) if inside else np.nan), np.array([-1.0 if inside else np.nan])

    (found,) = minimize_loss(loss, np.array([start]), np.eye(1) * 0.5, 1e-6)
    assert start <= found <= 1
