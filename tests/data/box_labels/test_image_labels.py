"""Boxes in images of COCO and YOLO, joined to the scans by the names of the images."""

import json

import cv2
import numpy as np
import pytest

from data.derived.motion_labels import evaluation_labels
from data.folder.labelled_drive import LabelledImagesDrive
from data.folder.observation import observe_folder
from data.open_drive import open_drive
from perception.errors import DriveError, LabelError
from tests.faults import fault

SIZE_PX = (40, 20)
CAMERA = """\
camera:
  images: camera
  fx_px: 30.0
  fy_px: 30.0
  cx_px: 20.0
  cy_px: 10.0
  lidar_to_camera: {roll_pitch_yaw_deg: [-90, 0, -90]}
labels: labels
"""
# Class, x1 y1 x2 y2 in pixels.
BOXES = (("pedestrian", 2.0, 4.0, 12.0, 18.0), ("car", 20.0, 8.0, 40.0, 20.0))


@pytest.fixture
def folder(drive_folder):
    root = drive_folder(CAMERA)
    (root / "camera").mkdir()
    for frame in range(2):
        image = np.zeros((SIZE_PX[1], SIZE_PX[0], 3), np.uint8)
        cv2.imwrite(str(root / f"camera/{frame:06d}.png"), image)
    (root / "labels").mkdir()
    return root


def write_coco(root, **more):
    annotations = [
        {"id": row, "image_id": 7, "category_id": 3 + row, "bbox": [x1, y1, x2 - x1, y2 - y1], "track_id": 5 + row}
        for row, (_, x1, y1, x2, y2) in enumerate(BOXES)
    ]  # fmt: skip
    annotations.append({"image_id": 7, "category_id": 3, "bbox": [0, 0, 2, 2], "iscrowd": 1})
    document = {
        "images": [
            {"id": 7, "file_name": "camera/000001.png", "width": 40, "height": 20},
            {"id": 8, "file_name": "camera/between.png", "width": 40, "height": 20},
        ],
        "categories": [{"id": 3 + row, "name": box[0]} for row, box in enumerate(BOXES)],
        "annotations": annotations,
    }
    (root / "labels/instances.json").write_text(json.dumps({**document, **more}))


def write_yolo(root, names="pedestrian\ncar\n"):
    rows = [
        f"{row} {(x1 + x2) / 80} {(y1 + y2) / 40} {(x2 - x1) / 40} {(y2 - y1) / 20}\n"
        for row, (_, x1, y1, x2, y2) in enumerate(BOXES)
    ]
    (root / "labels/000001.txt").write_text("".join(rows))
    (root / "labels/classes.txt").write_text(names)


def check(labels):
    np.testing.assert_allclose(labels.boxes_px, [box[1:] for box in BOXES], atol=1e-9)
    assert labels.types.tolist() == ["Pedestrian", "Car"]
    assert np.isnan(labels.boxes_velo.bottom_m).all()


def test_coco_names_the_labelled_images(folder):
    write_coco(folder)
    drive = open_drive(folder)
    assert isinstance(drive, LabelledImagesDrive) and drive.has_labels
    check(drive.labels(1))
    assert drive.labels(1).track_ids.tolist() == [5, 6]
    assert drive.labels(1).dont_care_px.tolist() == [[0, 0, 2, 2]]
    assert (len(drive.labels(0)), drive.labels(0).dont_care_px.tolist()) == (0, [[0, 0, 40, 20]])
    assert observe_folder(folder).config.labels == "labels"


@pytest.mark.parametrize("names", ["classes.txt", "data.yaml"])
def test_yolo_has_its_classes_in_a_list_beside_it(names, folder):
    write_yolo(folder)
    if names == "data.yaml":
        (folder / "labels/classes.txt").unlink()
        (folder / "data.yaml").write_text("names: {0: pedestrian, 1: car}\n")
    drive = open_drive(folder, images=False)
    check(drive.labels(1))
    assert drive.labels(0).dont_care_px.tolist() == [[0, 0, 40, 20]]
    (folder / "labels/000000.txt").write_text("1 0.1 0.1 0.5 0.1 0.5 0.6\n")  # an outline
    labels = open_drive(folder).labels(0)
    np.testing.assert_allclose(labels.boxes_px, [[4, 2, 20, 12]])
    assert not len(labels.dont_care_px)


def test_boxes_are_those_of_images_without_distortion(folder):
    write_yolo(folder)
    text = (folder / "drive.yaml").read_text()
    lens = "camera:\n  distortion: [-0.2, 0.02, 0, 0]\n"
    (folder / "drive.yaml").write_text(text.replace("camera:\n", lens))
    drive = open_drive(folder)
    lens = drive.images.lens
    for box, found in zip(BOXES, drive.labels(1).boxes_px, strict=True):
        edges = np.array(box[1:])[[[0, 1], [2, 3]]].reshape(-1, 1, 2)
        places = cv2.undistortPoints(edges, lens.camera_matrix, lens.coefficients, P=lens.pinhole_matrix)  # fmt: skip
        low, high = places.reshape(2, 2)
        assert (found[:2] <= low + 1e-9).all() and (found[2:] >= high - 1e-9).all()
        assert np.abs(found - np.concatenate([low, high])).max() < 3


def test_faults_of_image_labels_are_named(folder):
    write_yolo(folder, "pedestrian\n")
    with fault(LabelError, "000001.txt row 2", "a class of 0", "1", "classes.txt"):
        open_drive(folder).labels(1)
    (folder / "labels/000001.txt").write_text("0 0.5 0.5 nan 0.1\n")
    with fault(LabelError, "000001.txt row 1", "finite numbers of a box", "nan"):
        open_drive(folder).labels(1)
    (folder / "labels/000001.txt").unlink()
    write_coco(folder, images=[{"id": 7, "file_name": "x.png", "width": 40, "height": 20}])
    with fault(LabelError, "labels", "labels of images such as 000000", "none of the drive's"):
        open_drive(folder).labels(1)
    (folder / "drive.yaml").write_text((folder / "drive.yaml").read_text().partition("camera:")[0] + "labels: labels\n")  # fmt: skip
    with fault(DriveError, "drive.yaml", "a camera of these images", "labels of COCO alone"):
        open_drive(folder)


def test_evaluations_in_space_ask_for_3d_boxes(folder):
    write_coco(folder)
    with fault(LabelError, "drive", "labels of 3D boxes", "those of images alone"):
        evaluation_labels(open_drive(folder), 1)
