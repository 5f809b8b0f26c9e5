"""Objects that are put into another scan stand where nothing does, hide what is behind them, and are hidden themselves."""

import numpy as np
import pytest

from data.samples.bev.labelled_scans import BevObjects, LabelledScan
from data.samples.bev.pasting import paste
from perception.obstacles.range_image import SphericalProjection
from perception.sensor import HDL_32E

PROJECTION = SphericalProjection(HDL_32E, tolerance_m=0.1)
HEIGHT_M = HDL_32E.height_m


def returns_of(*, wall_m=None, box=None):
    """Return what every beam meets: a round wall, a box with its face at x, the ground."""
    azimuth = (np.arange(PROJECTION.columns) + 0.5) * PROJECTION.column_step_rad - np.pi
    elevation, azimuth = np.meshgrid(HDL_32E.elevations_rad, azimuth, indexing="ij")
    with np.errstate(divide="ignore"):
        level_m = np.where(elevation < -0.01, -HEIGHT_M / np.tan(elevation), np.inf)
    if wall_m is not None:
        level_m = np.minimum(level_m, wall_m)
    if box is not None:
        x_m, half_m, high_m = box
        at_m = np.where(np.cos(azimuth) > 0, x_m / np.cos(azimuth), np.inf)
        meets = np.abs(at_m * np.sin(azimuth)) < half_m
        meets &= HEIGHT_M + at_m * np.tan(elevation) < high_m
        level_m = np.where(meets & (at_m < level_m), at_m, level_m)
    seen = level_m < 60
    level_m, azimuth, elevation = level_m[seen], azimuth[seen], elevation[seen]
    points = np.stack(
        [level_m * np.cos(azimuth), level_m * np.sin(azimuth), level_m * np.tan(elevation), 0.4 + 0 * level_m],
        axis=1,
    )  # fmt: skip
    return points.astype(np.float32)


def scan_of(points, boxes=(), returns=()):
    boxes = np.array(boxes, np.float32).reshape(-1, 7)
    labels = BevObjects(
        boxes,
        np.array(["Pedestrian"] * len(boxes), np.str_),
        np.array(returns, np.int64).reshape(-1),
        np.array([0.0, np.pi], np.float32),
    )
    return LabelledScan(points, points[:, 2] + np.float32(HEIGHT_M), labels)


@pytest.fixture(scope="module")
def donor():
    points = returns_of(box=(10.0, 0.3, 1.7))
    return scan_of(points, [[10.2, 0, 0, 0.6, 0.6, 1.7, 0.4]], [60])


def on_person(scan, box):
    away_m = np.linalg.norm(scan.points_velo[:, :2] - box[:2], axis=1)
    return (away_m < 0.6) & (scan.heights_m > 0.12)


def test_an_object_keeps_range_beams_and_height_and_casts_a_shadow(donor):
    scan = scan_of(returns_of(wall_m=20.0))
    pasted = paste(scan, donor, np.array([0]), PROJECTION, np.random.default_rng(0))
    assert pasted.labels.types.tolist() == ["Pedestrian"]
    box = pasted.labels.boxes[0]
    assert np.hypot(*box[:2]) == pytest.approx(10.2, abs=1e-4)
    turn_rad = np.arctan2(box[1], box[0])
    assert box[6] == pytest.approx(
        np.arctan2(np.sin(0.4 + turn_rad), np.cos(0.4 + turn_rad)), abs=1e-4
    )
    before, after = on_person(donor, donor.labels.boxes[0]), on_person(pasted, box)
    assert after.sum() == before.sum() == pasted.labels.returns[0] > 30
    assert np.array_equal(np.sort(pasted.heights_m[after]), np.sort(donor.heights_m[before]))
    # Nothing of the wall is left behind it, and all of it elsewhere.
    turns = np.arctan2(pasted.points_velo[:, 1], pasted.points_velo[:, 0]) - turn_rad
    behind = np.abs(np.arctan2(np.sin(turns), np.cos(turns))) < 0.024
    ranges_m = np.linalg.norm(pasted.points_velo[:, :2], axis=1)
    # A beam over the person's feet would meet the ground from 11 m on, one over the head the wall at 1.5 m.
    assert not (behind & (ranges_m > 11.2) & (pasted.heights_m < 1.3)).any()
    assert (behind & (ranges_m > 19) & (pasted.heights_m > 1.5)).any()
    lost = len(scan.points_velo) + after.sum() - len(pasted.points_velo)
    assert 0.7 < lost / after.sum() < 1.5


def test_an_object_behind_a_wall_is_left_out(donor):
    scan = scan_of(returns_of(wall_m=6.0))
    pasted = paste(scan, donor, np.array([0]), PROJECTION, np.random.default_rng(0))
    assert len(pasted.labels) == 0
    assert np.array_equal(pasted.points_velo, scan.points_velo)


def test_objects_stand_apart_from_what_is_there(donor):
    scan = donor
    for seed in range(16):
        scan = paste(scan, donor, np.array([0]), PROJECTION, np.random.default_rng(seed))
    centers_m = scan.labels.boxes[:, :2]
    assert 10 < len(scan.labels) <= 17
    apart_m = np.linalg.norm(centers_m[:, None] - centers_m, axis=2) + 9 * np.eye(len(centers_m))
    assert apart_m.min() > 0.42 + 0.3
    assert scan.labels.view_rad.tolist() == pytest.approx([0, np.pi])


def test_what_is_hidden_has_fewer_returns(donor):
    far = scan_of(returns_of(box=(20.0, 6.0, 1.7)), [[20.2, 0, 0, 0.6, 12.0, 1.7, 0.0]], [400])
    near = scan_of(donor.points_velo, donor.labels.boxes, donor.labels.returns)
    for seed in range(40):
        pasted = paste(far, near, np.array([0]), PROJECTION, np.random.default_rng(seed))
        x_m, y_m = pasted.labels.boxes[-1, :2]
        if x_m > 0 and abs(y_m / x_m) < 0.25:
            assert 340 < pasted.labels.returns[0] < 395
            return
    pytest.fail("no direction before the wall was drawn")


def test_few_returns_are_not_put_elsewhere(donor):
    thin = LabelledScan(donor.points_velo[::40], donor.heights_m[::40], donor.labels)
    pasted = paste(donor, thin, np.array([0]), PROJECTION, np.random.default_rng(0))
    assert len(pasted.labels) == 1
