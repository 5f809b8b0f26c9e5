"""Labels that are written in a form have the same boxes, types and tracks when they are read."""

from typing import get_args

import numpy as np
import pytest

from data.box_labels.boxes import LabelledBox, LabelledFrame, read_content
from data.box_labels.form_names import LabelFormName
from data.box_labels.forms import FORM_OF_NAME, find_form
from data.box_labels.written_frames import labelled_frame
from data.exports.label_writer import LabelWriter
from data.labelled_objects import labels_of_boxes
from data.open_drive import open_drive
from perception.cli.main import main
from perception.geometry.se3 import wrap
from tests.data.box_labels.conftest import objects_of, true_boxes

IN_SPACE = [name for name, form in FORM_OF_NAME.items() if not form.is_of_image]
TRACKED = set(IN_SPACE) - {"labelcloud", "kitti"}


def test_every_form_has_a_name():
    assert set(FORM_OF_NAME) == set(get_args(LabelFormName))


@pytest.mark.parametrize("name", IN_SPACE)
@pytest.mark.parametrize("axes", ["[forward, left, up]", "[right, forward, up]"])
def test_labels_in_space_are_read_as_they_were_written(name, axes, drive_folder):
    root = drive_folder(frames=3)
    config = root / "drive.yaml"
    text = config.read_text()
    config.write_text(text.replace("labels: labels\n", ""))
    if axes != "[forward, left, up]":
        config.write_text(config.read_text().replace("rate_hz", f"axes: {axes}, rate_hz"))
        for path in (root / "lidar").iterdir():
            points = np.load(path)
            np.save(path, np.column_stack([-points[:, 1], points[:, 0], points[:, 2:]]))
    drive, frames = open_drive(root), []
    for index in (0, 2):  # the second is not labelled
        rows = objects_of(index)
        ids = np.array([int(one.track) for one in rows])
        labels = labels_of_boxes(true_boxes(index), [one.kind for one in rows], ids)
        pose = np.array([[0, -1, 0, 5 + index], [1, 0, 0, 7], [0, 0, 1, 1], [0, 0, 0, 1.0]])
        frames.append(labelled_frame(drive, index, labels, pose))
    form = FORM_OF_NAME[name]
    form.write(root / "labels", frames)
    assert find_form(root / "labels") is form
    config.write_text(f"{config.read_text()}labels: labels\n")
    read, tracks = open_drive(root), []
    for index in (0, 2):
        labels, truth = read.labels_around(index), true_boxes(index)
        order = np.argsort(labels.boxes_velo.bottom_m[:, 0])
        expected = np.argsort(truth.bottom_m[:, 0])
        labels, truth = labels[order], truth[expected]
        np.testing.assert_allclose(labels.boxes_velo.bottom_m, truth.bottom_m, atol=2e-4)
        np.testing.assert_allclose(labels.boxes_velo.size_m, truth.size_m, atol=2e-4)
        np.testing.assert_allclose(wrap(labels.boxes_velo.yaw_rad - truth.yaw_rad), 0, atol=2e-4)
        assert labels.types.tolist() == [objects_of(index)[row].kind for row in expected]
        tracks.append(labels.track_ids.tolist())
    # Tracklets have no gaps: what is seen again is another one.
    if name in TRACKED - {"tracklets"}:
        assert tracks[0] == tracks[1] and len(set(tracks[0])) == 4
    assert not len(read.labels(1))


@pytest.mark.parametrize("name", ["coco", "yolo"])
def test_labels_of_images_are_read_as_they_were_written(name, tmp_path):
    shares = ((0.25, 0.5, 0.0, 0.25, 0.5, 1.0, 0.0), (0.9, 0.5, 0.0, 0.2, 0.1, 1.0, 0.0))
    boxes = [LabelledBox("", kind, "3", one) for kind, one in zip(("Car", "Bus"), shares, strict=True)]  # fmt: skip
    frame = LabelledFrame("000001", 1, "1.bin", (), image="000001.png", size_px=(40, 20), image_boxes=boxes)  # fmt: skip
    form = FORM_OF_NAME[name]
    form.write(tmp_path, [frame])
    assert find_form(tmp_path) is form
    [path] = [one for one in tmp_path.iterdir() if one.name != "classes.txt"]
    [read] = form.read(path, read_content(path)).values()
    assert [(one.kind, one.numbers) for one in read] == [(one.kind, pytest.approx(one.numbers)) for one in boxes]  # fmt: skip


def test_a_run_that_was_stopped_goes_on_with_its_labels(drive_folder, tmp_path):
    drive = open_drive(drive_folder(""))
    first = LabelWriter(tmp_path, "openlabel", drive, 0.5)
    labels = labels_of_boxes(true_boxes(0), ["Car"] * 4, np.arange(4))
    first._frames.append(labelled_frame(drive, 0, labels, np.eye(4)))
    second = LabelWriter(tmp_path, "openlabel", drive, 0.5)
    second.restore(first.snapshot())
    assert second._frames[0].boxes == first._frames[0].boxes
    second.close(is_complete=True)
    assert len(read_content(tmp_path / "openlabel.json")["openlabel"]["objects"]) == 4


def test_a_run_writes_the_vehicles_that_it_shows(drive_folder, tmp_path):
    root, out = drive_folder("", frames=3), tmp_path / "labels"
    words = f"run {root} --out {tmp_path}/run --no-video --no-report --labels {out}"
    flags = "--label-form sustechpoints --pipeline.detection.modalities bev --pipeline.detection.display-score 0.1"
    assert main([*words.split(), *flags.split()]) == 0
    assert sorted(path.name for path in out.iterdir()) == [f"{index:06d}.json" for index in range(3)]  # fmt: skip
    assert find_form(out) is FORM_OF_NAME["sustechpoints"]
