"""Faults as data: named, sized, and the same for the same seed."""

from dataclasses import replace

import numpy as np
import pytest

from data.faults.injection import Fault, inject
from data.faults.kinds import FAULT_KINDS
from perception.errors import UsageError
from perception.geometry.camera import project
from tests.car_frames import CALIBRATION
from tests.faults import fault
from tests.health.scenes import frames

# Of any size of the images.
OF_SIZE = replace(CALIBRATION, image_size_px=None)


@pytest.fixture(scope="module")
def clean():
    return [replace(frame, calibration=OF_SIZE) for frame in frames(8)]


def is_same(one, other) -> bool:
    return (
        one.stamp_s == other.stamp_s
        and np.array_equal(one.points_velo, other.points_velo)
        and np.array_equal(np.asarray(one.image), np.asarray(other.image))
        and np.array_equal(np.asarray(one.world_SE3_velo), np.asarray(other.world_SE3_velo))
        and np.array_equal(one.calibration.cam_SE3_velo, other.calibration.cam_SE3_velo)
    )


@pytest.mark.parametrize("kind", FAULT_KINDS)
def test_a_fault_lasts_from_its_first_frame_to_its_last(kind, clean):
    faulty = list(inject(clean, [Fault(kind, 3, 6, seed=2)]))
    again = list(inject(clean, [Fault(kind, 3, 6, seed=2)]))
    assert all(map(is_same, faulty, again))
    assert [is_same(*pair) for pair in zip(faulty, clean, strict=True)][:4] == [True] * 3 + [False]
    assert is_same(faulty[7], clean[7])


def test_a_fault_is_read_from_a_text():
    assert Fault.parse("camera-dark:50-80") == Fault("camera-dark", 50, 80, None)
    assert Fault.parse("lidar-sector:2-4:90", seed=3) == Fault("lidar-sector", 2, 4, 90.0, 3)


def test_a_fault_of_another_form_or_name_is_refused():
    with fault(UsageError, "--fault", "KIND:FIRST-LAST", "'camera-dark'"):
        Fault.parse("camera-dark")
    with fault(UsageError, "--fault", "lidar-sector", "camera-drunk"):
        Fault.parse("camera-drunk:1-2")
    with fault(UsageError, "--fault", "a first frame not after the last", "4-2"):
        Fault.parse("camera-dark:4-2")


@pytest.mark.parametrize(
    ("kind", "size", "pixels"), [("yaw", 1.0, (6.3, 0.0)), ("pitch", -2.0, (0.0, 12.6)), ("shift", 0.5, (9.0, 0.0))]
)  # fmt: skip
def test_a_calibration_fault_moves_points_in_the_image(clean, kind, size, pixels):
    point_cam = np.array([0.0, 0.0, 20.0, 1.0])
    point_velo = np.linalg.solve(CALIBRATION.cam_SE3_velo, point_cam)[None, :3]
    faulty = next(inject(clean, [Fault(f"calibration-{kind}", 0, 0, size)])).calibration
    (moved_px,), (true_px,) = (
        project(one.image_P_cam @ one.cam_SE3_velo, point_velo)[0] for one in (faulty, CALIBRATION)
    )
    assert np.abs(moved_px - true_px) == pytest.approx(np.abs(pixels), abs=0.5)


def test_faults_of_two_sensors_meet(clean):
    both = [Fault("camera-missing", 2, 4), Fault("ins-absent", 3, 5)]
    faulty = list(inject(clean, both))
    assert [frame.image is None for frame in faulty] == [False] * 2 + [True] * 3 + [False] * 3
    assert [frame.world_SE3_velo is None for frame in faulty][2:6] == [False, True, True, True]


def test_a_lost_sector_is_as_wide_as_its_size(clean):
    faulty = next(inject(clean, [Fault("lidar-sector", 0, 0, 90.0)]))
    assert len(faulty.points_velo) == pytest.approx(0.75 * len(clean[0].points_velo), rel=0.01)


def test_lost_beams_are_whole_beams(clean):
    faulty = list(inject(clean, [Fault("lidar-beams", 1, 1, 0.25)]))[1]
    left = len(faulty.points_velo) / len(clean[1].points_velo)
    assert left * 16 == pytest.approx(12, abs=1.1)
