"""Boxes in OpenCV's XML: windows, objects that move, and files that are refused in a sentence."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from data.kitti360.bounding_boxes import AnnotatedBoxes, DriveBoxes
from perception.errors import LabelError
from perception.types import Boxes3D
from tests.faults import fault
from tests.kitti360_writer import Kitti360Object, write_boxes

_FIRST, _SECOND, _THIRD, _APART = (0, 100), (95, 200), (201, 300), (400, 500)


def _object(
    instance: int = 1,
    *,
    frame: int = -1,
    window: tuple[int, int] = _FIRST,
    x_m: float = 0.0,
    yaw_rad: float = 0.0,
    label: str = "car",
) -> Kitti360Object:
    box = Boxes3D(np.array([[x_m, 2.0, -1.0]]), np.array([[4.0, 1.8, 1.5]]), np.array([yaw_rad]))
    return Kitti360Object(label, instance, box, frame, window)


def _boxes(tmp_path: Path, objects: Sequence[Kitti360Object]) -> DriveBoxes:
    write_boxes(tmp_path / "drive.xml", objects)
    return DriveBoxes(tmp_path / "drive.xml")


def _x_m(boxes: AnnotatedBoxes) -> list[float]:
    return sorted(boxes.boxes_world.bottom_m[:, 0].round(6).tolist())


def test_a_box_has_the_place_and_size_of_its_mesh(tmp_path):
    (box,) = [_boxes(tmp_path, [_object(x_m=7.0, yaw_rad=2.0)]).at(50)]
    np.testing.assert_allclose(box.boxes_world.bottom_m, [[7.0, 2.0, -1.0]], atol=1e-12)
    np.testing.assert_allclose(box.boxes_world.size_m, [[4.0, 1.8, 1.5]], atol=1e-12)
    np.testing.assert_allclose(box.boxes_world.yaw_rad, 2.0, atol=1e-12)


def test_static_boxes_are_seen_from_the_windows_that_adjoin_theirs(tmp_path):
    windows = (_FIRST, _SECOND, _THIRD, _APART)
    boxes = _boxes(tmp_path, [_object(n + 1, window=w, x_m=n) for n, w in enumerate(windows)])
    assert _x_m(boxes.at(50)) == [0, 1]
    assert _x_m(boxes.at(150)) == [0, 1, 2]
    assert _x_m(boxes.at(250)) == [1, 2]
    assert _x_m(boxes.at(450)) == [3]
    assert [boxes.is_annotated(frame) for frame in (0, 100, 300, 301, 399, 400, 501)] == [
        True, True, True, False, False, True, False,
    ]  # fmt: skip


def test_an_object_of_two_windows_counts_once_as_in_the_nearer(tmp_path):
    boxes = _boxes(tmp_path, [_object(window=_FIRST, x_m=1), _object(window=_SECOND, x_m=2)])
    assert [_x_m(boxes.at(frame)) for frame in (10, 190)] == [[1], [2]]
    assert boxes.at(10).track_ids == boxes.at(190).track_ids


def test_boxes_of_one_object_and_objects_without_a_number_have_ids_of_their_own(tmp_path):
    parts = [_object(3, x_m=1), _object(3, x_m=2), _object(0, x_m=3), _object(0, x_m=4)]
    boxes = _boxes(tmp_path, [*parts, _object(0, x_m=5, window=_SECOND)])
    assert _x_m(boxes.at(50)) == [1, 2, 3, 4, 5]
    assert len(set(boxes.at(50).track_ids.tolist())) == 5


def test_boxes_that_move_are_interpolated_over_short_gaps(tmp_path):
    half = np.pi - 0.1
    boxes = _boxes(
        tmp_path,
        [
            _object(frame=10, x_m=0.0, yaw_rad=half),
            _object(frame=14, x_m=2.0, yaw_rad=-half),
            _object(frame=20, x_m=9.0),
            _object(2, frame=14, x_m=50.0),
        ],
    )
    assert _x_m(boxes.at(14)) == [2, 50]
    between = boxes.at(11)
    assert _x_m(between) == [0.5]
    assert np.cos(between.boxes_world.yaw_rad[0] - (half + 0.05)) == pytest.approx(1)
    assert [len(boxes.at(frame)) for frame in (9, 17, 21)] == [0, 0, 0]


def test_classes_are_types_of_kitti_and_others_are_no_objects(tmp_path):
    labels = ("car", "truck", "bus", "train", "person", "rider", "bicycle", "trash bin", "trailer",
              "road", "building", "bigPole", "vegetation")  # fmt: skip
    boxes = _boxes(tmp_path, [_object(n + 1, label=one) for n, one in enumerate(labels)])
    kinds = ["Car", "Truck", "Truck", "Tram", "Pedestrian", "Cyclist", "Misc", "Misc", "Misc"]
    assert boxes.at(0).types.tolist() == kinds
    only_stuff = _boxes(tmp_path, [_object(label="road")])
    assert (len(only_stuff.at(0)), only_stuff.is_annotated(0)) == (0, True)


_MATRIX = (
    '<{0} type_id="opencv-matrix"><rows>4</rows><cols>4</cols><dt>f</dt><data>{1}</data></{0}>'
)
_TRANSFORM = _MATRIX.format("transform", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1")
_VERTICES = _MATRIX.format("vertices", ".5 .5 .5 -.5 -.5 -.5")
_NUMBERS = "<instanceId>1</instanceId><timestamp>-1</timestamp><start_frame>0</start_frame><end_frame>9</end_frame>"
_CAR = f"<object1>\n<label>car</label>{_NUMBERS}{_TRANSFORM}{_VERTICES}</object1>"


def _bomb() -> str:
    entities = "".join(f'<!ENTITY a{n + 1} "{f"&a{n};" * 10}">' for n in range(9))
    return (
        f'<!DOCTYPE x [<!ENTITY a0 "aaaaaaaaaa">{entities}]><opencv_storage>&a9;</opencv_storage>'
    )


@pytest.mark.parametrize(
    ("text", "where", "expected", "found"),
    [
        ("", "line 1", "XML of OpenCV", "no element found"),
        ("<opencv_storage>\n<object1>", "line 2", "XML of OpenCV", "no element found"),
        ("<opencv_storage>\n</object1>", "line 2", "XML of OpenCV", "mismatched tag"),
        ("<boxes/>", "line 1", "<opencv_storage>", "<boxes>"),
        (_bomb(), "line 1", "without a DOCTYPE", "one"),
        ('<!DOCTYPE x SYSTEM "file:///etc/passwd"><opencv_storage/>', "line 1", "without a DOCTYPE", "one"),
        ("<opencv_storage>" + "<a>" * 20, "line 1", "XML of OpenCV", "more than 16 deep"),
        (_CAR.replace(_TRANSFORM, ""), "line 2", "an object with transform/data", "none"),
        (_CAR.replace("<label>car</label>", ""), "line 2", "an object with label", "none"),
        (_CAR.replace(">-1<", ">soon<"), "line 2", "a whole number as timestamp", "'soon'"),
        (_CAR.replace(">1</instance", ">9999999999</instance"), "line 2", "a whole number as instanceId", "'9999999999'"),
        (_CAR.replace(">0</start", ">12</start"), "line 2", "a start_frame up to the end_frame", "12 and 9"),
        (_CAR.replace(">1 0 0 0 0 1", ">1 0 0 0 0 x"), "line 2", "rows of 4 numbers as transform", "could not convert"),
        (_CAR.replace(">1 0 0 0 0 1", ">1 0 0 0 1"), "line 2", "rows of 4 numbers as transform", "15 words"),
        (_CAR.replace(">1 0 0 0 0 1", ">nan 0 0 0 0 1"), "line 2", "numbers in metres as transform", "nan"),
        (_CAR.replace(">1 0 0 0 0 1", ">0 0 0 0 0 1"), "line 2", "a box with a size", "0.0, 1.0, 1.0"),
        (_CAR.replace("-.5 -.5 -.5", ""), "line 2", "a box with a size", "0.0, 0.0, 0.0"),
    ],
)  # fmt: skip
def test_damaged_files(tmp_path, text, where, expected, found):
    path = tmp_path / "drive.xml"
    path.write_text(
        f"<opencv_storage>\n{text}</opencv_storage>" if text.startswith("<object1>") else text
    )
    with fault(LabelError, f"drive.xml {where}", expected, found):
        DriveBoxes(path).at(0)


def test_a_file_that_is_gone(tmp_path):
    with fault(LabelError, "drive.xml", "XML of OpenCV", "no file"):
        DriveBoxes(tmp_path / "drive.xml").at(0)
