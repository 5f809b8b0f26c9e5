import numpy as np

from perception.geometry.grids import LocalArea
from perception.geometry.se3 import from_euler
from perception.obstacles.motion_segmentation import StaticMap
from perception.obstacles.voxels import KeyCounts, VoxelGrid

GRID = VoxelGrid(np.array([-100.0, -100, -10]), (2000, 2000, 200), 0.1)
HERE = np.eye(4)
NO_KEYS = np.zeros(0, np.int64)


def seen_at(*places, counts=None):
    keys = np.sort(GRID.keys(np.array(places)))
    return KeyCounts(keys, np.array(counts or [1] * len(places)))


def nothing():
    return KeyCounts(NO_KEYS, NO_KEYS)


def nowhere(places):
    return np.zeros(len(places), bool)


def everywhere(places):
    return np.ones(len(places), bool)


def test_a_voxel_stays_for_as_many_scans_as_are_remembered():
    static_map = StaticMap(GRID, LocalArea(), memory_scans=2)
    lengths = [len(static_map.update(seen_at([5.05, 0.05, 0.05]), NO_KEYS, HERE, nowhere))]
    lengths += [len(static_map.update(nothing(), NO_KEYS, HERE, nowhere)) for _ in range(3)]
    assert lengths == [1, 1, 1, 0]


def test_counts_add_up():
    static_map = StaticMap(GRID, LocalArea(), memory_scans=6)
    place = [5.05, 0.05, 0.05]
    static_map.update(seen_at(place, counts=[4]), NO_KEYS, HERE, nowhere)
    voxels = static_map.update(
        seen_at(place, [6.05, 0.05, 0.05], counts=[3, 2]), NO_KEYS, HERE, nowhere
    )
    assert voxels.counts.tolist() == [7, 2]
    np.testing.assert_allclose(voxels.centers_m[0], place, atol=1e-4)


def test_a_beam_that_passes_removes_what_is_not_seen():
    static_map = StaticMap(GRID, LocalArea(), memory_scans=6)
    static_map.update(seen_at([5.05, 0.05, 0.05], [7.05, 0.05, 0.05]), NO_KEYS, HERE, nowhere)
    voxels = static_map.update(seen_at([7.05, 0.05, 0.05]), NO_KEYS, HERE, everywhere)
    np.testing.assert_allclose(voxels.centers_m, [[7.05, 0.05, 0.05]], atol=1e-4)


def test_a_moving_voxel_is_not_static():
    static_map = StaticMap(GRID, LocalArea(), memory_scans=6)
    seen = seen_at([5.05, 0.05, 0.05])
    static_map.update(seen, NO_KEYS, HERE, nowhere)
    assert len(static_map.update(nothing(), seen.keys, HERE, nowhere)) == 0


def test_voxels_are_given_in_the_frame_of_the_scan_and_end_with_the_area():
    static_map = StaticMap(GRID, LocalArea(), memory_scans=6)
    place = np.array([5.05, 0.05, 0.05])
    static_map.update(seen_at(place), NO_KEYS, HERE, nowhere)
    ahead = from_euler(0, 0, np.pi / 2, np.array([4.0, 0, 0]))
    voxels = static_map.update(nothing(), NO_KEYS, ahead, nowhere)
    np.testing.assert_allclose(voxels.centers_m, [[0.05, -1.05, 0.05]], atol=1e-4)
    far = from_euler(0, 0, 0, np.array([12.0, 0, 0]))
    assert len(static_map.update(nothing(), NO_KEYS, far, nowhere)) == 0
