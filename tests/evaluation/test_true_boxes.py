import numpy as np

from perception.evaluation.detection.box_rows import TrueBoxes
from perception.types import Boxes3D, Labels


def labels(types: list[str], regions: int) -> Labels:
    count = len(types)
    return Labels(
        boxes_velo=Boxes3D(np.zeros((count, 3)), np.ones((count, 3)), np.zeros(count)),
        boxes_px=np.arange(4.0 * count).reshape(-1, 4),
        types=np.array(types, np.str_),
        track_ids=np.full(count, -1),
        truncation=np.full(count, 0.25),
        occlusion=np.full(count, 2),
        dont_care_px=np.full((regions, 4), 77.0),
    )


def test_frames_follow_each_other_and_regions_their_objects():
    rows = TrueBoxes.of_frames([labels(["Car", "Van"], 1), labels([], 0), labels(["Car"], 2)])
    np.testing.assert_array_equal(rows.frames, [0, 0, 0, 2, 2, 2])
    assert rows.types.tolist() == ["Car", "Van", "DontCare", "Car", "DontCare", "DontCare"]
    np.testing.assert_array_equal(rows.boxes_px[:, 0], [0, 4, 77, 0, 77, 77])
    np.testing.assert_array_equal(rows.occlusion, [2, 2, -1, 2, -1, -1])
    np.testing.assert_array_equal(rows.truncation, [0.25, 0.25, -1, 0.25, -1, -1])
    np.testing.assert_array_equal(rows.alphas_rad, np.full(6, -10.0))


def test_no_frames_and_no_labels_are_no_rows():
    assert len(TrueBoxes.of_frames([])) == 0
    assert len(TrueBoxes.of_frames([labels([], 0)])) == 0
