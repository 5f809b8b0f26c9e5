"""Errors of poses against values worked out by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from perception.evaluation.pose_errors import PoseMeasure, pooled
from perception.geometry.se3 import from_euler
from perception.localization.ins_fusion import is_flat
from perception.types import Health, HealthFinding, HealthLevel


def pose(x_m, y_m=0.0, z_m=0.0, yaw_deg=0.0, pitch_deg=0.0):
    matrix = from_euler(0.0, np.radians(pitch_deg), np.radians(yaw_deg))
    matrix[:3, 3] = x_m, y_m, z_m
    return matrix


def measured(reference, poses, findings=()):
    measure = PoseMeasure(reference)
    for index, one in enumerate(poses):
        frame = SimpleNamespace(index=index)
        health = Health.of(findings if index == 1 else ())
        timings_s = {"registration": 0.01 * (1 + index % 2)}
        result = SimpleNamespace(
            frame=frame, world_SE3_velo=one, health=health, timings_s=timings_s
        )
        measure.update(result, None, None)
    return measure


def straight(count, step_m=1.0, **tilt):
    # The height changes, so that it is one that was measured.
    return [pose(step_m * k, z_m=0.1 * np.sin(k), **tilt) for k in range(count)]


def test_poses_in_another_world_have_no_error():
    reference = straight(12)
    world = pose(100.0, -50.0, 3.0, yaw_deg=130.0)
    found = measured(reference, [world @ one for one in reference]).compute()
    assert found.step_max_deg == pytest.approx(0, abs=1e-5)
    assert found.step_max_cm == pytest.approx(0, abs=1e-9)
    assert (found.yaw_deg, found.end_m) == pytest.approx((0, 0), abs=1e-9)
    assert found.drift_percent == pytest.approx(0, abs=1e-9)
    assert (found.p50_ms, found.faults) == (15.0, {})


def test_a_turn_and_a_longer_step():
    reference = straight(4)
    poses = [reference[0], reference[1]]
    # From the second frame on turned by 2 degrees, and 30 cm farther ahead in the third.
    poses.append(pose(2.3, z_m=reference[2][2, 3], yaw_deg=2.0))
    poses.append(poses[-1] @ (np.linalg.inv(reference[2]) @ reference[3]))
    found = measured(reference, poses).compute()
    assert (found.step_p50_deg, found.step_max_deg) == pytest.approx((0, 2), abs=1e-6)
    assert found.step_p90_deg == pytest.approx(1.6, abs=1e-5)  # 0, 0, 2: at 0.9 of the way
    assert (found.step_yaw_max_deg, found.yaw_deg, found.end_deg) == pytest.approx((2, 2, 2))
    assert (found.step_p50_cm, found.step_max_cm) == pytest.approx((0, 30), abs=1e-6)
    assert found.step_p90_cm == pytest.approx(24, abs=1e-6)
    end_m = np.hypot(0.3 + np.cos(np.radians(2)) - 1, np.sin(np.radians(2)))
    assert found.end_m == pytest.approx(end_m)


def test_drift_is_a_share_of_the_length_of_sub_paths():
    reference = straight(161)
    poses = [pose(1.02 * one[0, 3], z_m=one[2, 3]) for one in reference]
    measure = measured(reference, poses)
    found = measure.compute()
    assert measure.lengths_m[0] == 100
    # Steps up and down lengthen the way a little, so that a sub-path is a little less than 100 m.
    assert found.drift_percent == pytest.approx(2.0, abs=0.02)
    assert found.drift_deg_100m == pytest.approx(0, abs=1e-6)
    short = measured(reference[:31], poses[:31])
    assert short.lengths_m == (10, 20, 50)
    assert short.compute().drift_percent == pytest.approx(2.0, abs=0.1)


def test_a_constant_height_is_none_that_was_measured():
    lever = pose(0.9, 0.0, 1.8)  # of the LiDAR, above the point that keeps its height
    level = [pose(k, yaw_deg=3.0 * k, pitch_deg=np.sin(k)) @ lever for k in range(12)]
    assert is_flat(level)
    assert not is_flat(level[:7])  # too few tell it
    assert not is_flat([pose(0.0)] * 12)  # nor does a vehicle that stands
    uneven = [pose(k, z_m=1e-3 * np.sin(k)) @ lever for k in range(12)]
    assert not is_flat(uneven)
    raised = [one.copy() for one in level]
    for index, one in enumerate(raised):
        one[2, 3] += 0.05 * index
    found = measured(level, raised).compute()
    assert found.step_max_cm < 0.5
    assert found.end_m < 0.05


def test_of_poses_without_tilt_the_heading_alone_is_measured():
    level = [pose(k, yaw_deg=3.0 * k) for k in range(12)]
    tilted = [one @ pose(0.0, yaw_deg=0.5 * k, pitch_deg=2.0 * k) for k, one in enumerate(level)]
    assert PoseMeasure(level).is_level  # before the first frame
    measure = measured(level, tilted)
    found = measure.compute()
    assert found.end_deg == pytest.approx(found.yaw_deg)
    assert found.yaw_deg == pytest.approx(5.5)
    swaying = [one @ pose(0.0, pitch_deg=np.sin(k)) for k, one in enumerate(level)]
    measure = measured(swaying, swaying)
    assert measure.is_flat
    assert not measure.is_level
    # Errors of the tilt count where it is one that was measured: 22 degrees at the last frame.
    uneven = straight(12)
    pitched = [one @ pose(0.0, pitch_deg=2.0 * k) for k, one in enumerate(uneven)]
    assert measured(uneven, pitched).compute().end_deg == pytest.approx(22)


def test_sub_paths_start_at_every_tenth_frame():
    reference = straight(31)
    # Two metres too far in the step to frame 15: of the sub-paths of 10 m from frames 0, 10 and 20, and that of 20 m from 0
    # and 10, those from 10 and of 20 m from 0 hold it.
    poses = [pose(one[0, 3] + 2.0 * (k >= 15), z_m=one[2, 3]) for k, one in enumerate(reference)]
    found = measured(reference, poses).compute()
    # Errors 0, 10 % (from 0); 20, 10 % (from 10); 0 (from 20).
    assert found.drift_percent == pytest.approx(100 * (0 + 0.1 + 0.2 + 0.1 + 0) / 5)


def test_findings_are_counted_by_frame():
    finding = HealthFinding("registration", HealthLevel.WARN, "pose lost", "no motion")
    assert measured(straight(4), straight(4), findings=[finding]).compute().faults == {
        "pose lost": 1
    }


def test_of_several_drives_steps_count_together_and_the_largest_end():
    reference = straight(3)
    turned = [reference[0], reference[1], reference[2] @ pose(0.4, yaw_deg=3.0)]
    found = pooled([measured(reference, reference), measured(reference, turned)])
    # Steps of both: 0, 0, 0 and 3 degrees with 40 cm.
    assert (found.step_p50_deg, found.step_max_deg) == pytest.approx((0, 3), abs=1e-6)
    assert found.step_p90_cm == pytest.approx(28)
    assert (found.yaw_deg, found.end_m, found.end_deg) == pytest.approx((3, 0.4, 3))
    assert found.p50_ms == pytest.approx(10)
