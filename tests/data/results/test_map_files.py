"""Maps are of each camera, and need its image for the size alone."""

from dataclasses import replace

import numpy as np
import pytest

from data.further_cameras import DriveCamera, FurtherCameras
from data.open_drive import open_drive
from data.results.map_files import without_unused_images
from perception.maps.densify import densify
from perception.maps.projection import project_frame


@pytest.mark.parametrize("is_size_stated", [True, False])
def test_only_an_image_that_tells_the_size_is_read(raw_drive, is_size_stated):
    drive = open_drive(raw_drive)
    size_px = drive.calibration.image_size_px if is_size_stated else None
    drive = replace(drive, calibration=replace(drive.calibration, image_size_px=size_px))
    further = DriveCamera("left", drive.calibration, drive.images)
    drive = replace(drive, further_cameras=FurtherCameras((further,)))
    seen = without_unused_images(drive)
    assert seen.has_images == (not is_size_stated)
    for index in range(2):
        for views in zip(drive[index].views, seen[index].views, strict=True):
            assert (views[1].image is None) == is_size_stated
            whole, lean = (densify(project_frame(one)) for one in views)
            np.testing.assert_array_equal(lean.depth_m, whole.depth_m)
            np.testing.assert_array_equal(lean.reflectance, whole.reflectance)


def test_sizes_of_object_frames_are_those_of_their_images(kitti_root):
    assert without_unused_images(open_drive(kitti_root / "object")).has_images
