"""False movers over speed and distance: clusters that do not move, counted once a scan."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from benchmarks.studies.false_movers import MoverCounts, _measure
from data.synthetic.drive import CachedDrive
from perception.errors import UsageError
from perception.evaluation.exact_obstacles import count_false, false_clusters_m
from perception.geometry.grids import LocalArea
from perception.sensor import VLP_16
from tests.faults import command, fault


def test_false_clusters_have_a_place():
    still, mover, few = (np.tile([x, 0.0], (n, 1)) for x, n in ((20.0, 8), (0.0, 8), (-20.0, 3)))
    points_m = np.concatenate([still, mover, few])
    is_moving = np.repeat([False, True, False], (8, 8, 3))
    np.testing.assert_allclose(false_clusters_m(points_m, is_moving), [[20, 0]])
    assert count_false(points_m, is_moving) == 1
    assert false_clusters_m(points_m[:0], is_moving[:0]).shape == (0, 2)


def test_counts_of_drives_are_added():
    one = MoverCounts(10, (4.0, 12.0), 2, 20, 3)
    both = one + MoverCounts(30, (15.0, 50.0), 6, 5, 1)
    assert (both.scans, both.movers, both.missed) == (40, 25, 4)
    assert (both.false_a_scan, both.halted_a_scan) == pytest.approx((0.1, 0.2))
    np.testing.assert_allclose(both.false_by_distance(), [0.025, 0, 0.05, 0, 0])


def test_movers_are_counted_on_a_road():
    found = _measure((5.0, 2), 4, VLP_16, LocalArea(40.0, 40.0, 40.0))
    assert (found.scans, found.movers, len(found.false_m), found.halted) == (4, 8, 0, 0)
    assert found.missed <= 7


class HaltingDrive(CachedDrive):
    """Half of the vehicles come to a halt in its last frame, by its truth alone."""

    def point_truth(self, index):
        truth = super().point_truth(index)
        stays = truth.is_moving & (truth.instances % 2 > 0) if index == 19 else truth.is_moving
        return replace(truth, is_moving=stays)


def test_what_has_just_halted_is_counted_apart(monkeypatch):
    monkeypatch.setattr(
        "data.synthetic.drive.SyntheticDrive",
        lambda frames, **flags: HaltingDrive(frames, seed=1, sensor=VLP_16),
    )
    found = _measure((8.0, 1), 20, VLP_16, LocalArea(40.0, 40.0, 40.0))
    assert found.halted > 0


@pytest.mark.slow
def test_the_study_has_a_row_a_speed(tmp_path, capsys):
    out = tmp_path / "movers.png"
    words = ["--sensor", "VLP-16", "--frames", "2", "--speeds-m-s", "5,20", "--workers", "1"]
    command("study", "false-movers", *words, "--out", str(out))
    rows = json.loads(out.with_suffix(".json").read_text())["results"]["movers"]
    assert list(rows) == ["5 m/s", "20 m/s", "all"]
    assert [row["scans"] for row in rows.values()] == [2, 2, 4]
    assert cv2.imread(str(out)).std() > 5
    printed = capsys.readouterr().out
    assert "30 to 40 m" in printed
    assert "halted" in printed


@pytest.mark.parametrize("speeds", ["0,5", "[]"])
def test_speeds_are_above_0(speeds):
    with fault(UsageError, "--speeds-m-s", expected="speeds above 0"):
        command("study", "false-movers", "--speeds-m-s", speeds)
