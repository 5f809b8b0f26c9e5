"""Frames validate the times of their points, and are freed with their last reference."""

import gc
import weakref

import numpy as np
import pytest

from perception.errors import PerceptionError, ScanError
from perception.types import CameraImage, Frame
from tests.faults import fault

POINTS_VELO = np.ones((3, 4), np.float32)


def frame(times_s) -> Frame:
    return Frame(0, 0.0, POINTS_VELO, source="a.bin", point_times_s=np.array(times_s, np.float32))


def test_times_of_points_are_kept():
    assert frame([-0.05, 0, 0.05]).point_times_s.tolist() == pytest.approx([-0.05, 0, 0.05])
    assert Frame(0, 0.0, POINTS_VELO).point_times_s is None


def test_each_point_has_a_time():
    with fault(PerceptionError, "a.bin point_times_s", "shape (3)", "shape (2,)"):
        frame([0, 0.1])


@pytest.mark.parametrize("wrong", [1e8, np.nan])
def test_times_of_another_unit_are_refused(wrong):
    with fault(ScanError, "a.bin", "within 1 s of the scan's", advice="in seconds"):
        frame([0, 0.1, wrong])


@pytest.mark.parametrize("further", [(), (CameraImage("left", None),)])
def test_a_frame_whose_views_were_used_is_freed_without_collection_of_cycles(further):
    gc.disable()
    try:
        used = Frame(0, 0.0, POINTS_VELO, further_cameras=further)
        assert [view.camera for view in used.views] == ["camera", *(one.name for one in further)]
        assert used.views[0] is used
        freed = weakref.ref(used)
        del used
        assert freed() is None
    finally:
        gc.enable()
