"""The drive in memory: determinism, poses and the INS."""

import numpy as np
import pytest

from data.synthetic import ins
from data.synthetic.drive import SyntheticDrive
from data.synthetic.ins import InsNoise
from perception.errors import UsageError
from perception.geometry import se3
from perception.sensor import VLP_16
from perception.types import Frame
from tests.faults import fault


@pytest.mark.slow
def test_same_seed_same_drive_bit_by_bit(street_drive):
    twin = SyntheticDrive(40, seed=3)
    last, first = twin[39], twin[0]
    assert np.array_equal(first.points_velo, street_drive.scan(0).points_velo)
    assert np.array_equal(last.points_velo, street_drive.scan(39).points_velo)
    assert np.array_equal(last.image, street_drive.image(39))
    assert np.array_equal(last.world_SE3_velo, street_drive.world_SE3_velo(39))


def test_another_seed_is_another_drive(street_drive):
    other = SyntheticDrive(2, seed=4, sensor=VLP_16, images=False)
    assert other.true_world_SE3_velo(1) != pytest.approx(street_drive.true_world_SE3_velo(1))
    assert other[0].image is None


def test_frames_are_frames(street_drive):
    frame = street_drive[-1]
    assert isinstance(frame, Frame)
    assert (frame.index, frame.stamp_s) == (39, pytest.approx(3.9))
    assert frame.image.shape == (375, 1242, 3)
    assert 90_000 < len(frame.points_velo) < 135_000
    with pytest.raises(IndexError):
        street_drive[40]


def test_ins_poses_are_off_by_their_noise(street_drive):
    offsets = np.array(
        [
            (se3.inverse(street_drive.true_world_SE3_velo(i)) @ street_drive.world_SE3_velo(i))[
                :3, 3
            ]
            for i in range(40)
        ]
    )
    assert 0.003 < offsets.std(axis=0).mean() < 0.03


def test_without_noise_the_ins_is_exact():
    drive = SyntheticDrive(
        4, seed=5, sensor=VLP_16, noise=InsNoise(position_m=0.0, angle_deg=0.0), images=False
    )
    for index in range(4):
        assert drive.world_SE3_velo(index) == pytest.approx(
            drive.true_world_SE3_velo(index), abs=1e-5
        )


def test_ins_errors_have_the_stated_deviation_and_memory():
    error = ins.errors(20_000, 0.1, 0.02, np.random.default_rng(0))
    assert error.std() == pytest.approx(0.02, rel=0.1)
    step = np.diff(error, axis=0).std() / error.std()
    # One tenth of the variance is white: sqrt(2 * 0.1 + 2 * 0.9 * (1 - exp(-0.02))).
    assert step == pytest.approx(0.486, rel=0.05)


def test_nonsense_is_refused():
    with fault(UsageError, expected="at least one frame"):
        SyntheticDrive(0)
    with fault(UsageError, expected="deviations of 0 or more"):
        InsNoise(position_m=-1.0)
