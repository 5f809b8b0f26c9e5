from dataclasses import dataclass

import numpy as np
import pytest

from perception.evaluation.confusion import Confusion, confusion
from perception.evaluation.ground import (
    GroundErrors,
    displacement_by_interval,
    ground_confusion,
    ground_errors,
    mean_displacement_error,
    pooled_displacement_error,
)
from perception.geometry.grids import LocalArea
from perception.types import Float, Float64, PointState


@dataclass(frozen=True)
class Plane:
    """z = slope * x + height."""

    slope: float
    height: float

    def height_m(self, xy_m: Float) -> Float64:
        return self.slope * xy_m[:, 0] + self.height

    def distance_m(self, points_velo: Float) -> Float64:
        normal = np.array([-self.slope, 0.0, 1.0]) / np.hypot(self.slope, 1.0)
        return (points_velo[:, :3] - (0.0, 0.0, self.height)) @ normal


AREA = LocalArea()


def test_the_distance_to_a_tilted_plane_is_along_its_normal():
    # 3-4-5: the plane rises 3 in 4, so a point 1 m over it is 4/5 m from it.
    ground = Plane(slope=0.75, height=0.0)
    feet = np.array([[4.0, 0.0, 4.0], [4.0, 2.0, 3.0], [8.0, 0.0, 5.0]])
    errors = ground_errors(0, ground, feet, AREA)
    np.testing.assert_allclose(np.abs(errors.errors_m), [0.8, 0.0, 0.8], atol=1e-12)


def test_only_feet_in_the_area_count():
    feet = np.array([[10, 0, -1.7], [24, 9, -1.7], [26, 0, 9], [10, 11, 9], [-6, 0, 9]])
    errors = ground_errors(3, Plane(0.0, -1.73), feet, AREA)
    np.testing.assert_allclose(errors.errors_m, [0.03, 0.03])
    np.testing.assert_allclose(errors.ranges_m, [10, np.hypot(24, 9)])
    assert errors.frames.tolist() == [3, 3]


def made_up_errors() -> GroundErrors:
    """Two objects in frame 0 (errors +2 and -4 cm), one in frame 5 (+1 cm)."""
    return GroundErrors(
        frames=np.array([0, 0, 5]),
        bottom_centers_m=np.array([[-7.0, 0.0], [22.0, 0.0], [24.0, 10.0]]),
        errors_m=np.array([0.02, -0.04, 0.01]),
    )


def test_frames_weigh_the_same_however_many_objects_they_have():
    figure = mean_displacement_error(made_up_errors())
    assert figure.mde_m == pytest.approx((0.03 + 0.01) / 2)
    assert figure.bias_m == pytest.approx((-0.01 + 0.01) / 2)
    assert (figure.frames, figure.objects) == (2, 3)


def test_no_object_gives_no_figure():
    figure = mean_displacement_error(GroundErrors.concatenate([]))
    assert np.isnan(figure.mde_m)
    assert (figure.frames, figure.objects) == (0, 0)


def test_errors_by_range_add_up_to_all():
    errors, edges_m = made_up_errors(), (0, 5, 10, 25)
    figures = displacement_by_interval(errors, errors.ranges_m, edges_m)
    assert list(figures) == ["0 to 5 m", "5 to 10 m", "10 to 25 m", "over 25 m"]
    assert [figure.objects for figure in figures.values()] == [0, 1, 1, 1]
    mde_m = [figure.mde_m for figure in figures.values()]
    np.testing.assert_allclose(mde_m[1:], [0.02, 0.04, 0.01])


def test_slices_end_at_lines_of_x():
    errors = made_up_errors()
    figures = displacement_by_interval(errors, errors.bottom_centers_m[:, 0], (-10, 0, 23))
    bias_m = [figure.bias_m for figure in figures.values()]
    np.testing.assert_allclose(bias_m, [0.02, -0.04, 0.01])


def test_ratios_of_counts():
    counts = confusion(
        predicted=np.array([1, 1, 1, 0, 0, 0], bool), target=np.array([1, 1, 0, 1, 0, 0], bool)
    )
    assert counts == Confusion(true_positives=2, false_positives=1, false_negatives=1)
    assert counts.precision == pytest.approx(2 / 3)
    assert counts.recall == pytest.approx(2 / 3)
    assert counts.f1 == pytest.approx(2 / 3)
    assert counts.iou == pytest.approx(2 / 4)
    assert counts + counts == Confusion(4, 2, 2)


def test_ratios_of_zero_points_are_not_a_number():
    assert np.isnan([Confusion().precision, Confusion().recall, Confusion().f1]).all()


def test_ground_points_by_hand():
    ground, static, outside = PointState.GROUND, PointState.STATIC, PointState.OUTSIDE
    rows = [
        # x, state, class
        (3, ground, 40),  # road, found
        (3, static, 48),  # the face of a kerb: missed
        (3, ground, 10),  # a car's sill taken for ground
        (3, static, 10),  # a car, rightly no ground
        (3, ground, 0),  # unlabelled: does not count
        (7, ground, 72),  # terrain, found
        (7, outside, 40),  # too low for the area: missed
        (26, ground, 40),  # beyond the area: does not count
    ]
    by_range = ground_confusion(
        points_velo=np.array([(x, 0, -1.7) for x, _, _ in rows]),
        states=np.array([state for _, state, _ in rows], np.uint8),
        classes=np.array([kind for _, _, kind in rows]),
        area=AREA,
    )
    # From 0, 5, 10, 15, 20 and 25 m on.
    expected = [Confusion(1, 1, 1), Confusion(1, 0, 1), *[Confusion()] * 4]
    assert list(by_range.values()) == expected


def test_the_error_of_several_sequences_is_the_mean_over_all_their_frames():
    errors = made_up_errors()
    other = GroundErrors(errors.frames[:1], errors.bottom_centers_m[:1], np.array([0.5]))
    parts = [mean_displacement_error(part) for part in (errors, other, errors[:0])]
    numbered_on = GroundErrors(
        np.append(errors.frames, errors.frames.max() + 1),
        np.concatenate([errors.bottom_centers_m, other.bottom_centers_m]),
        np.append(errors.errors_m, 0.5),
    )
    pooled, whole = pooled_displacement_error(parts), mean_displacement_error(numbered_on)
    assert pooled.mde_m == pytest.approx(whole.mde_m)
    assert pooled.bias_m == pytest.approx(whole.bias_m)
    assert (pooled.frames, pooled.objects) == (whole.frames, whole.objects)
    assert np.isnan(pooled_displacement_error([]).mde_m)
