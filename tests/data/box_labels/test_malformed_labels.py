"""What is no record where a form has one, a row that is cut off, and degrees in forms of several axes are named."""

import json
import math

import pytest

from data.box_labels import box_labels
from data.box_labels.boxes import read_content
from data.open_drive import open_drive
from perception.errors import LabelError
from tests.data.box_labels import writers
from tests.faults import fault


def rewrite(root, name, change):
    path = root / "labels" / name
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))


MALFORMED = {
    "openlabel": (
        "openlabel.json", lambda doc: doc["openlabel"]["frames"].update({"6": None}), "frame 6", "a record", "NoneType",
    ),
    "datumaro": (
        "default.json", lambda doc: doc["items"][1].update(annotations=[3]), "item 000001 annotations 1", "a record", "int",
    ),
    "supervisely": (
        "annotation.json", lambda doc: doc["frames"][1].update(figures=["car"]), "frame 1 figures 1", "a record", "str",
    ),
    "nuscenes_tables": (
        "instance.json", lambda doc: doc.__setitem__(1, 7), "instance.json rows 2", "a record", "int",
    ),
    "labelcloud_corners": (
        "000001.json", lambda doc: doc["objects"][0]["vertices"].pop(), "object 1", "an entry 7", "a list of 7",
    ),
    "sustechpoints": (
        "000001.json", lambda doc: doc[0].update(obj_type=None), "object 1", "an entry 'obj_type'", "psr",
    ),
}  # fmt: skip


@pytest.mark.parametrize("form", MALFORMED)
def test_what_is_no_record_is_named(form, drive_folder):
    name, change, *sentence = MALFORMED[form]
    root = drive_folder()
    writers.FORMS[form](root, 2)
    rewrite(root, name, change)
    with fault(LabelError, *sentence):
        open_drive(root).labels_around(0)


def test_a_row_that_is_cut_off_is_named(drive_folder):
    root = drive_folder()
    writers.kitti_lidar(root, 2)
    path = root / "labels" / "000001.txt"
    first, second = path.read_text().splitlines()[:2]
    path.write_text(f"{first}\n{second.rpartition(' ')[0]}\n")
    with fault(LabelError, "000001.txt row 2", "8, 15 or 17 words", "14"):
        open_drive(root).labels_around(0)


def test_degrees_are_named_in_forms_of_several_axes(drive_folder):
    root = drive_folder()
    writers.datumaro(root, 2)

    def to_degrees(document):
        for item in document["items"]:
            for box in item["annotations"]:
                box["rotation"][2] = math.degrees(box["rotation"][2])

    rewrite(root, "default.json", to_degrees)
    with fault(LabelError, "item 000000 cuboid 4", "a heading in rad", "headings in degrees"):
        open_drive(root).labels_around(0)


def test_a_fault_is_read_once(drive_folder, monkeypatch):
    root, reads = drive_folder(), []
    writers.sustechpoints(root, 2)
    rewrite(root, "000001.json", lambda doc: doc[0].update(obj_type=None))
    monkeypatch.setattr(
        box_labels, "read_content", lambda path: reads.append(path) or read_content(path)
    )
    drive = open_drive(root)
    for index in (0, 1):
        with fault(LabelError, "000001.json object 1", "'obj_type'", "psr"):
            drive.labels_around(index)
    assert [path.name for path in reads] == ["000000.json", "000001.json"]
