import numpy as np
import pytest

from data.synthetic.drive import CachedDrive, SyntheticDrive
from data.synthetic.ins import InsNoise
from perception.sensor import VLP_16

GOOD, BAD = InsNoise(0.0, 0.0), InsNoise(1.0, 2.0)


@pytest.fixture(scope="module")
def drive():
    return CachedDrive(2, seed=3, sensor=VLP_16, noise=GOOD)


def test_it_is_the_drive_that_forgets(drive):
    again = drive.with_ins(BAD)
    fresh = SyntheticDrive(2, seed=3, sensor=VLP_16, noise=BAD, images=False)
    for index in range(2):
        np.testing.assert_array_equal(again[index].points_velo, fresh[index].points_velo)
        np.testing.assert_array_equal(again.world_SE3_velo(index), fresh.world_SE3_velo(index))
        np.testing.assert_array_equal(
            again.true_world_SE3_velo(index), fresh.true_world_SE3_velo(index)
        )


def test_scans_are_shared_and_poses_are_not(drive):
    other = drive.with_ins(BAD)
    assert other.scan(1) is drive.scan(1)
    assert drive.scan(-1) is drive.scan(1)
    apart = other.world_SE3_velo(1) - drive.world_SE3_velo(1)
    assert np.abs(apart).max() > 0.01
    np.testing.assert_allclose(drive.world_SE3_velo(1), drive.true_world_SE3_velo(1), atol=1e-6)
