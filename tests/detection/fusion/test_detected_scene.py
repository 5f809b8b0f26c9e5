"""What a scene knows about its modalities, by hand."""

import numpy as np

from perception.detection.fusion.detected_scene import DetectedScene, remaining_sets
from tests.detection.fusion.scenes import SIZE_PX, detections


def test_a_class_is_searched_by_the_detectors_that_know_it():
    found = {"rgb": detections([]), "rm": detections([])}
    scene = DetectedScene(found, SIZE_PX, {"rgb": ("Car", "Van"), "rm": ("Car",)})
    types = np.array(["Car", "Van", "Tram"])
    assert scene.searched(types).tolist() == [
        [True, False, True],
        [True, False, False],
        [False] * 3,
    ]
    assert scene.set_names(types).tolist() == ["rgb+rm", "rgb", ""]


def test_what_may_remain_of_three_modalities():
    sets = ["+".join(names) for names in remaining_sets(("rgb", "dm", "rm"), 2)]
    assert sets == ["rgb+dm+rm", "rgb+dm", "rgb+rm", "dm+rm"]
    assert list(remaining_sets(("rgb",), 2)) == []
