"""Labels of every form have the same boxes, types and tracks, and are looked for beside the scans."""

import numpy as np
import pytest

from data.derived.motion_labels import LabelledAround
from data.folder.labelled_drive import LabelledFolderDrive
from data.open_drive import open_drive
from perception.geometry.se3 import wrap
from tests.data.box_labels import writers
from tests.data.box_labels.conftest import objects_of, true_boxes


def labels_at(root, index=1):
    drive = open_drive(root)
    assert isinstance(drive, LabelledFolderDrive)
    return drive.labels_around(index)


@pytest.mark.parametrize("form", writers.FORMS)
def test_boxes_and_types_of_every_form(form, drive_folder):
    root = drive_folder()
    writers.FORMS[form](root, 2)
    drive = open_drive(root)
    assert drive.has_labels and isinstance(drive, LabelledAround)
    for index in range(2):
        labels, truth = drive.labels_around(index), true_boxes(index)
        np.testing.assert_allclose(labels.boxes_velo.bottom_m, truth.bottom_m, atol=1e-6)
        np.testing.assert_allclose(labels.boxes_velo.size_m, truth.size_m, atol=1e-6)
        np.testing.assert_allclose(wrap(labels.boxes_velo.yaw_rad - truth.yaw_rad), 0, atol=1e-6)
        assert labels.types.tolist() == [one.kind for one in objects_of(index)]


@pytest.mark.parametrize("form", sorted(writers.TRACKED))
def test_an_object_has_one_id_in_all_frames(form, drive_folder):
    root = drive_folder()
    writers.FORMS[form](root, 2)
    ids = [labels_at(root, index).track_ids.tolist() for index in range(2)]
    assert ids[0] == ids[1] and len(set(ids[0])) == 4 and min(ids[0]) >= 0
