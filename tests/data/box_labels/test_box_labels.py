"""Labels of every form have the same boxes, types and tracks, and are looked for beside the scans."""

import json

import numpy as np
import pytest

from data.array_store import ArrayStore
from data.box_labels.label_types import label_type
from data.derived.motion_labels import LabelledAround, evaluation_labels
from data.folder.labelled_drive import LabelledFolderDrive
from data.folder.observation import observe_folder
from data.open_drive import open_drive
from data.samples.bev.labelled_scans import LabelledScans
from perception.cli.main import main
from perception.detection.bev.bev_map import BevGrid
from perception.errors import LabelError
from perception.geometry.se3 import wrap
from tests.data.box_labels import writers
from tests.data.box_labels.conftest import objects_of, true_boxes
from tests.faults import fault


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


def rewrite(root, change, name="000001.json"):
    path = root / "labels" / name
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))


def set_number(part, axis, value):
    def change(document):
        document[2]["psr"][part][axis] = value

    return change


FAULTS = {
    "NaN": (set_number("position", "y", float("nan")), "000001.json object 3", "finite numbers", "nan"),
    "no size": (set_number("scale", "x", 0), "000001.json object 3", "sizes above 0", "0 x 0.7 x 1.7"),
    "a word": (set_number("scale", "x", "wide"), "object 3", "numbers x, y, z", "wide"),
    "no heading": (lambda doc: doc[0]["psr"].pop("rotation"), "object 1", "'rotation'", "position, scale"),
    "an id twice": (lambda doc: doc[1].update(obj_id="7"), "object 2", "each id once", "7 there and in"),
    "degrees": (set_number("rotation", "z", 90), "object 3", "a heading in rad", "90, as headings in degrees are"),
    "another form": (lambda doc: doc[0].pop("psr"), "000001.json", "SUSTechPOINTS, as the other", "another content"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_names_file_and_object(name, drive_folder):
    change, where, expected, found = FAULTS[name]
    root = drive_folder()
    writers.sustechpoints(root, 2)
    rewrite(root, change)
    with fault(LabelError, where, expected, found):
        labels_at(root, 0)  # a fault of any frame is met before anything is made of the others


def test_labels_without_a_scan_are_named(drive_folder):
    root = drive_folder()
    writers.sustechpoints(root, 3)
    with fault(
        LabelError, "000002.json object 1", "labels of scans", "none of 2 scans", "add the scan"
    ):
        labels_at(root)


def test_two_files_of_a_scan_are_named(drive_folder):
    root = drive_folder()
    writers.sustechpoints(root, 2)
    (root / "labels" / "1.json").write_text("[]")
    with fault(LabelError, "1.json", "a scan once", "labels of 000001 again"):
        labels_at(root)


def test_an_object_twice_under_one_id_is_named(drive_folder):
    root = drive_folder()
    writers.openlabel(root, 2)
    path = root / "labels" / "openlabel.json"
    name = next(iter(json.loads(path.read_text())["openlabel"]["objects"]))
    path.write_text(path.read_text().replace(f'"{name}": ', f'"{name}": {{}}, "{name}": '))
    with fault(LabelError, path.name, "each id once", f"'{name}' twice"):
        labels_at(root)


def test_a_file_that_is_cut_off_is_named(drive_folder):
    root = drive_folder()
    writers.sustechpoints(root, 2)
    path = root / "labels" / "000000.json"
    path.write_text(path.read_text()[:-9])
    with fault(LabelError, "000000.json", "JSON", "line 1", "cut off"):
        labels_at(root)


def test_content_of_no_form_is_named(drive_folder):
    root = drive_folder()
    (root / "labels").mkdir()
    (root / "labels" / "a.txt").write_text("some words\n")
    with fault(LabelError, "labels", "labels of labelCloud, SUSTechPOINTS", "another content"):
        open_drive(root)


def place(change):
    """Return a change of all centres, and of headings, of an object in SUSTechPOINTS' form."""

    def all_of(document):
        for one in document:
            psr = one["psr"]
            p, heading = psr["position"], psr["rotation"]
            p["x"], p["y"], p["z"], heading["z"] = change(
                p["x"], p["y"], p["z"], heading["z"], psr["scale"]
            )

    return all_of


MISTAKES = {
    "x and y have changed places": place(lambda x, y, z, h, s: (y, x, z, np.pi / 2 - h)),
    "y is right": place(lambda x, y, z, h, s: (x, -y, z, -h)),
    "in the axes of a camera": place(lambda x, y, z, h, s: (-y, -z, x, -h - np.pi / 2)),
    "headings are clockwise": place(lambda x, y, z, h, s: (x, y, z, -h)),
    "off by a quarter turn": place(lambda x, y, z, h, s: (x, y, z, h + np.pi / 2)),
    "z is that of the bottom": place(lambda x, y, z, h, s: (x, y, z - s["z"] / 2, h)),
    "lengths are in centimetres": lambda document: [
        one["psr"][part].update({axis: 100 * value for axis, value in one["psr"][part].items()})
        for one in document
        for part in ("position", "scale")
    ],
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_in_the_axes_is_named(name, drive_folder):
    root = drive_folder()
    writers.sustechpoints(root, 2)
    for frame in range(2):
        rewrite(root, MISTAKES[name], f"{frame:06d}.json")
    with fault(LabelError, "json object", "around the returns", name, "in the axes of the scans"):
        labels_at(root)


ORDERS = {
    "they belong to the scan before": lambda frame: max(frame - 1, 0),
    "they belong to the scan after": lambda frame: min(frame + 1, 7),
    "their order is reversed": lambda frame: 7 - frame,
}


@pytest.mark.parametrize("name", ORDERS)
def test_a_mistake_in_the_order_of_frames_is_named(name, drive_folder):
    root = drive_folder(frames=8)
    for frame in range(8):
        rows = [writers.psr(one) for one in objects_of(ORDERS[name](frame))]
        writers._write(root / f"labels/{frame:06d}.json", rows)
    with fault(LabelError, "json object", "around the returns", name, "frames may be shifted"):
        labels_at(root)


def test_labels_are_checked_without_a_damaged_scan(drive_folder):
    root = drive_folder(frames=8)
    writers.sustechpoints(root, 8)
    for frame in (0, 4):
        (root / f"lidar/{frame:06d}.npy").write_bytes(b"cut")
    assert len(labels_at(root, 1)) == 4


def test_labels_of_other_frames_are_noticed(drive_folder):
    root = drive_folder()
    writers.sustechpoints(root, 2)
    for frame in range(2):
        rewrite(root, place(lambda x, y, z, h, s: (x + 20, y * 4, z, h)), f"{frame:06d}.json")
    with fault(LabelError, "json object", "around the returns", "of 8 boxes with returns"):
        labels_at(root)


def test_a_scan_without_a_file_is_not_labelled(drive_folder):
    root = drive_folder()
    writers.sustechpoints(root, 1)
    assert labels_at(root, 1) is None
    drive = open_drive(root)
    assert len(drive.labels(1)) == 0
    assert evaluation_labels(drive, 1) is None
    assert len(labels_at(root, 0)) == 4


def test_a_frame_without_objects_is_labelled_in_a_file_of_all(drive_folder):
    root = drive_folder()
    writers.tracklets(root, 1)
    assert len(labels_at(root, 0)) == 4 and len(labels_at(root, 1)) == 0


def test_classes_are_renamed_in_any_case(drive_folder):
    root = drive_folder(
        "labels: labels\nclasses: {AUTOMOBILE: car, truck: Bus, Pedestrian: Post}\n"
    )
    writers.sustechpoints(root, 2)
    for frame in range(2):
        rewrite(root, lambda doc: doc[0].update(obj_type="Automobile"), f"{frame:06d}.json")
    assert labels_at(root).types.tolist() == ["Car", "Bus", "Post", "Cyclist"]


NAMES = {
    "car": "Car", "PERSON": "Pedestrian", "bus": "Bus", "vehicle.bus.rigid": "Bus", "human.pedestrian.adult": "Pedestrian",
    "REGULAR_VEHICLE": "Car", "vehicle.motorcycle": "Motorcycle", "Tram": "Tram", "traffic cone": "traffic cone",
}  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_names_of_tools_and_sets_are_types(name):
    assert label_type(name, {}) == NAMES[name]


def test_labels_follow_the_axes_of_the_files(drive_folder):
    root = drive_folder()
    writers.sustechpoints(root, 2)
    text = (root / "drive.yaml").read_text()
    (root / "drive.yaml").write_text(
        text.replace("lidar: {", "lidar: {axes: [backward, right, up], ")
    )
    truth, boxes = true_boxes(1), labels_at(root).boxes_velo
    np.testing.assert_allclose(boxes.bottom_m, truth.bottom_m * (-1, -1, 1), atol=1e-6)
    np.testing.assert_allclose(wrap(boxes.yaw_rad - truth.yaw_rad - np.pi), 0, atol=1e-6)


def test_a_part_of_a_drive_keeps_its_labels(drive_folder):
    root = drive_folder()
    writers.sustechpoints(root, 2)
    part = open_drive(root).select([1])
    np.testing.assert_allclose(
        part.labels_around(0).boxes_velo.bottom_m, true_boxes(1).bottom_m, atol=1e-6
    )
    assert [path.name for path in part.frame_files(0)] == [
        "000001.npy",
        "000001.json",
        "drive.yaml",
    ]


def test_adopt_finds_the_labels_by_their_content(drive_folder):
    root = drive_folder("")
    writers.openlabel(root, 2)
    (root / "labels").rename(root / "Annotations_of_tool")
    (root / "drive.yaml").unlink()
    seen = observe_folder(root)
    assert seen.config.labels == "Annotations_of_tool"
    assert [one.value for one in seen.observations if one.what == "labels"] == ["ASAM OpenLABEL"]
    assert len(open_drive(root).labels_around(0)) == 4


def test_adopt_finds_labels_among_the_scans(drive_folder):
    root = drive_folder("")
    writers.labelcloud(root, 2)
    for path in (root / "labels").glob("0*.json"):
        path.rename(root / "lidar" / path.name)
    assert observe_folder(root).config.labels == "lidar"


def test_scans_with_labels_of_none_have_none(drive_folder):
    assert observe_folder(drive_folder("")).config.labels is None


def test_scans_with_labels_train_without_a_camera(drive_folder, tmp_path):
    root = drive_folder()
    writers.sustechpoints(root, 1)
    scans = LabelledScans([open_drive(root)], BevGrid(), ArrayStore(tmp_path / "cache"))
    labelled, unlabelled = scans.labels(0), scans.labels(1)
    assert labelled.types.tolist() == [one.kind for one in objects_of(0)]
    assert labelled.view_rad.tolist() == pytest.approx([0.0, np.pi])
    assert (labelled.returns > 100).all()
    assert len(unlabelled) == 0 and unlabelled.view_rad[1] < 0  # nothing is learned there


def test_tracklets_declare_no_entities(drive_folder):
    root = drive_folder()
    writers.tracklets(root, 1)
    path = root / "labels" / "tracklet_labels.xml"
    declared = "<!DOCTYPE boost_serialization [<!ENTITY a 'b'>]>"
    path.write_text(path.read_text().replace("<!DOCTYPE boost_serialization>", declared))
    with fault(LabelError, "tracklet_labels.xml", "XML without declarations", "a DOCTYPE"):
        labels_at(root)


def test_tracklets_that_are_cut_off_are_named(drive_folder):
    root = drive_folder()
    writers.tracklets(root, 1)
    path = root / "labels" / "tracklet_labels.xml"
    path.write_text(path.read_text()[:-20])
    with fault(LabelError, "tracklet_labels.xml line 3", "XML", "an error"):
        labels_at(root)


def test_tables_without_a_sample_leave_its_scan_without_labels(drive_folder):
    root = drive_folder()
    writers.nuscenes_tables(root, 1)
    assert labels_at(root, 1) is None and len(labels_at(root, 0)) == 4
    rewrite(root, lambda rows: rows[2].update(sample_token="s9"), "sample_annotation.json")
    with fault(LabelError, "sample_annotation.json record 3", "a scan in sample_data.json", "s9"):
        labels_at(root)


def test_without_a_camera_the_virtual_one_shows_labels(drive_folder, capsys):
    root = drive_folder()
    writers.sustechpoints(root, 2)
    labels = open_drive(root).labels(0)
    assert labels.types.tolist() == ["Car", "Pedestrian", "Cyclist"]  # the truck is behind
    low, high = labels.boxes_px[:, :2], labels.boxes_px[:, 2:]
    assert ((low >= 0) & (low < high) & (high <= (1242, 375))).all()
    assert main(["check", str(root)]) == 0
    assert "no faults" in capsys.readouterr().out
    words = "--no-report --pipeline.detection.display-score 0.1"
    assert main(["evaluate", "vehicles", str(root), *words.split()]) == 0
    assert "Pedestrian" in capsys.readouterr().out
