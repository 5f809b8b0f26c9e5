import numpy as np
import pytest

from perception.obstacles.rigid_bodies import _Paths

AGES_S = [0.5, 1.0, 1.5]


def evidence(paths, distances_m):
    """Return evidence of 20 for one distance since each scan, and of -60 for all others but 0."""
    tables = []
    for came_m, of_scan in zip(distances_m, paths.distances_m, strict=True):
        table = np.where(np.isclose(of_scan, came_m, atol=0.01), 20.0, -60.0)
        table[len(table) // 2] = 0.0
        tables.append(table)
    return tables


@pytest.mark.parametrize(
    ("distances_m", "moves"),
    [
        ((0.9, 1.8, 2.7), True),
        ((-0.9, -1.8, -2.7), True),
        ((0.0, 0.0, 0.0), False),
        ((0.0, 0.9, 1.8), False),
        ((0.9, -1.8, 2.7), False),
        ((0.3, 0.3, 0.3), False),
    ],
    ids=["steady", "backwards", "at rest", "halted", "to and fro", "pose off"],
)
def test_a_body_moves_where_one_way_explains_all_scans(distances_m, moves):
    paths = _Paths.since(AGES_S)
    assert (paths.log_odds(evidence(paths, distances_m), 0.0, 0.1) > 0) == moves


def test_what_moved_before_needs_less_evidence_the_sooner_the_next_scan():
    paths = _Paths.since(AGES_S)
    weak = [table / 6 for table in evidence(paths, (0.9, 1.8, 2.7))]
    odds = [paths.log_odds(weak, *one) for one in ((1.0, 0.1), (1.0, 0.5), (0.5, 0.1), (0.0, 0.1))]
    assert odds == sorted(odds, reverse=True)
    assert odds[0] > 0 > odds[-1]


def test_distances_end_where_a_body_has_left_its_place():
    paths = _Paths.since([0.1])
    assert paths.distances_m[0][[0, -1]] == pytest.approx([-8.0, 8.0], abs=0.31)
