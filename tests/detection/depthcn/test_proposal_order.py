import numpy as np

from perception.detection.depthcn.proposal_order import order_scores
from perception.detection.depthcn.proposals import Proposals

FOCAL_PX = 700.0


def seen(width_m, height_m, depth_m):
    """A box of that size at that depth."""
    return [0, 0, width_m * FOCAL_PX / depth_m, height_m * FOCAL_PX / depth_m]


def test_what_is_as_large_as_a_car_comes_first_at_any_depth():
    rows = [(0.5, 1.7, 10), (1.8, 1.5, 40), (4.2, 1.5, 5), (9.0, 4.0, 20), (0.2, 6.0, 8)]
    found = Proposals(
        np.array([seen(*row) for row in rows]),
        np.array([depth_m for *_, depth_m in rows], float),
        np.zeros(0, int),
    )
    scores = order_scores("size", found, FOCAL_PX)
    np.testing.assert_allclose(scores[[1, 2]], 0, atol=1e-12)  # the end of one, the side of one
    # A person is a third as wide as a car is from behind, and a little higher.
    np.testing.assert_allclose(scores[0], -np.log(3) - np.log(1.7 / 1.5))
    np.testing.assert_array_equal(np.argsort(-scores, kind="stable"), [1, 2, 0, 3, 4])


def test_a_box_without_extent_comes_last_and_stays_finite():
    found = Proposals(
        np.array([[5.0, 5, 5, 5], seen(2, 1.5, 10)]), np.array([10.0, 10]), np.zeros(0, int)
    )
    scores = order_scores("size", found, FOCAL_PX)
    assert np.isfinite(scores).all()
    assert scores[0] < scores[1]


def test_proposals_of_more_returns_come_first():
    found = Proposals(np.zeros((3, 4)), np.ones(3), np.array([-1, 2, 2, 0, -1, 2, 0]))
    np.testing.assert_array_equal(order_scores("points", found, FOCAL_PX), [2, 0, 3])


def test_no_proposals_have_no_order():
    none = Proposals(np.zeros((0, 4)), np.zeros(0), np.full(4, -1))
    assert order_scores("points", none, FOCAL_PX).shape == (0,)
    assert order_scores("size", none, FOCAL_PX).shape == (0,)
