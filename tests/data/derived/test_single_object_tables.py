from collections import Counter

import numpy as np
import pytest

from data.derived.object_truth import DriveObjects
from data.derived.otd_objects import table_3_2, table_a_1, unique_sequences
from data.kitti.calibration import read_benchmark_calibration
from data.kitti.labels import empty_labels, read_tracking_labels
from perception.evaluation.single_object.challenges import Challenge, Variations, variations
from perception.evaluation.single_object.track import ObjectSequence

PRINTED_FRAMES = (
    154, 154, 101, 18, 58, 144, 78, 78, 122, 314, 297, 101, 42, 136, 38, 51, 42, 31, 24, 390, 36,
    65, 56, 474, 63, 99, 41, 323, 188, 51, 41, 131, 132, 140, 141, 112, 31, 112, 145, 54, 45, 264,
    71, 125, 146, 156, 45, 188, 359, 360,
)  # fmt: skip


def test_both_tables_are_whole():
    assert [one.name for one in table_3_2()] == [f"3.2 ({number})" for number in range(1, 9)]
    assert [one.frame_count for one in table_3_2()] == [154, 154, 373, 41, 149, 45, 71, 188]
    assert [one.name for one in table_a_1()] == [f"OTD {number}" for number in range(1, 51)]
    assert tuple(one.frame_count for one in table_a_1()) == PRINTED_FRAMES
    assert {one.kind for one in table_a_1()} == {"Car", "Van", "Truck", "Pedestrian", "Cyclist"}
    assert all(0 <= one.first_frame < one.last_frame for one in [*table_3_2(), *table_a_1()])


def test_rows_of_the_tables():
    van = table_a_1()[1]
    assert (van.sequence, van.track_id, van.kind) == ("0000", 0, "Van")
    assert (van.first_frame, van.last_frame) == (0, 153)
    assert van.stated == {"object_status": "moving", "ego_status": "moving", "scene": "urban"}
    truck = table_a_1()[23]
    assert (truck.sequence, truck.track_id, truck.first_frame, truck.last_frame) == (
        "0009",
        66,
        329,
        802,
    )
    walker = table_3_2()[7]
    assert (walker.sequence, walker.track_id, walker.first_frame) == ("0019", 27, 199)
    assert walker.stated["distance"] == "middle-near"
    assert walker.stated["scene"] == "downtown"
    assert table_3_2()[1].printed["center_m"] == {"h-fus": 1.98, "3d-kf": 17.69, "3d-ms": 1.84}
    assert walker.printed["center_px"]["cbwh"] == 162.1
    assert walker.printed["folded_heading_rad"]["l-fus"] == 0.15
    assert Counter(one.stated["object_status"] for one in table_a_1())["stationary"] == 10
    assert Counter(one.stated["ego_status"] for one in table_a_1())["stationary"] == 11


def test_what_both_tables_hold_is_followed_once():
    together = unique_sequences([*table_3_2(), *table_a_1()])
    assert len(together) == 53
    assert [one.name for one in together if "=" in one.name] == [
        "3.2 (1) = OTD 1",
        "3.2 (2) = OTD 2",
        "3.2 (6) = OTD 41",
        "3.2 (7) = OTD 43",
        "3.2 (8) = OTD 48",
    ]
    assert together[0].stated["occlusion"] == "none"
    assert together[0].stated["object_status"] == "moving"


@pytest.fixture(scope="module")
def labelled(kitti_root) -> dict[str, DriveObjects]:
    """Return the labels of every sequence that is there, by name."""
    training = kitti_root / "tracking" / "training"
    found = {}
    for path in sorted((training / "label_02").glob("*.txt")):
        calibration = read_benchmark_calibration(training / "calib" / path.name)
        labels = read_tracking_labels(path, calibration.camera)
        frames = range(max(labels) + 1)
        found[path.stem] = DriveObjects(
            path.stem,
            [0.1 * frame for frame in frames],
            [labels.get(frame, empty_labels()) for frame in frames],
            None,
        )
    return found


def there(labelled: dict[str, DriveObjects], table: tuple[ObjectSequence, ...]):
    return [(one, labelled[one.sequence].track(one)) for one in table if one.sequence in labelled]


def test_every_object_is_labelled_in_every_frame_as_what_it_is(labelled):
    rows = there(labelled, table_3_2() + table_a_1())
    assert len(rows) >= 57  # all but one, whose labels are not at hand
    for one, track in rows:
        assert len(track) == one.frame_count
        kinds = {
            kept.kind
            for kept in labelled[one.sequence].sequences(15)
            if kept.track_id == one.track_id
        }
        assert kinds == {one.kind}


@pytest.mark.parametrize(
    ("number", "size_m"),  # printed for the first frame: length, width, height
    [(1, (1.78, 0.82, 1.73)), (2, (4.43, 1.82, 2.00)), (24, (10.81, 2.89, 3.52)), (50, (0.85, 0.84, 1.72))],
)  # fmt: skip
def test_labels_have_the_printed_sizes(labelled, number: int, size_m: tuple[float, ...]):
    one = table_a_1()[number - 1]
    track = labelled[one.sequence].track(one)
    np.testing.assert_allclose(track.boxes_velo.size_m[0], size_m, atol=0.011)


STATED = {Challenge.OCC: "occlusion", Challenge.POS: "pose", Challenge.RVL: "velocity"}


def test_challenges_agree_with_the_words_of_table_3_2(labelled):
    differ: dict[Challenge, list[str]] = {challenge: [] for challenge in STATED}
    for one, track in there(labelled, table_3_2()):
        found = variations(track).challenges()
        for challenge, factor in STATED.items():
            if (challenge in found) != (one.stated[factor] not in ("no", "none")):
                differ[challenge].append(one.name)
    assert differ == {Challenge.OCC: [], Challenge.POS: [], Challenge.RVL: ["3.2 (8)"]}


def test_challenges_of_sequence_0000(labelled):
    cyclist, van, parked = (track for _, track in there(labelled, table_a_1()[:3]))
    assert variations(cyclist).challenges() == (Challenge.POS, Challenge.DIS)
    assert variations(van).challenges() == tuple(Challenge)
    assert Challenge.RVL not in variations(parked).challenges()
    assert variations(parked).challenges(Variations(occluded_share=0.9, turn_deg=180)) == (
        Challenge.DIS,
    )
