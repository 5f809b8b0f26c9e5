import cv2

from perception.render.timeline import plot_timeline
from perception.types import StageSpan


def test_a_timeline_is_a_picture_with_a_row_for_each_worker(tmp_path):
    spans = [
        StageSpan("registration", "obstacles", 0.0, 0.03),
        StageSpan("maps", "vehicles", 0.0, 0.01),
        StageSpan("detectors", "vehicles", 0.01, 0.012),
    ]
    for count in (1, 3):
        plot_timeline(tmp_path / f"{count}.png", "a frame", spans[:count], turn_s=0.1)
    one, two = (cv2.imread(str(tmp_path / f"{count}.png")) for count in (1, 3))
    assert two.shape[0] > one.shape[0]
    assert two.shape[1] == one.shape[1]
