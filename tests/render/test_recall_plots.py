import cv2
import numpy as np
import pytest

from perception.evaluation.detection.proposal_recall import ProposalRecall, RecallMetrics
from perception.render.recall_plots import plot_recall_by_count, plot_recall_by_iou


def recall(reached: int) -> ProposalRecall:
    ranks = np.array([*range(reached), *[-1] * (8 - reached)])
    some = RecallMetrics(8, {0.7: ranks, 0.5: ranks}, np.where(ranks < 0, 0.2, 0.8))
    none = RecallMetrics(0, {0.7: ranks[:0], 0.5: ranks[:0]}, np.zeros(0))
    return ProposalRecall(2, 20, 12, {"easy": some, "hard": none})


@pytest.mark.parametrize(("plot", "rows"), [(plot_recall_by_count, 2), (plot_recall_by_iou, 1)])
def test_a_panel_a_difficulty_and_one_without_objects_stays_empty(tmp_path, plot, rows):
    path = tmp_path / "made" / "recall.png"
    plot(path, "recall", {"best": recall(7), "thesis": recall(3)})
    image = cv2.imread(str(path))
    height, width = image.shape[:2]
    is_colored = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)[..., 1] > 80
    for row in range(rows):
        band = is_colored[row * height // rows : (row + 1) * height // rows]
        assert band[:, : width // 2].sum() > 1000
        assert band[:, width // 2 :].sum() == 0


def test_settings_without_any_proposal_are_drawn_too(tmp_path):
    nothing = ProposalRecall(1, 0, 0, {"all": RecallMetrics(2, {0.7: np.full(2, -1)}, np.zeros(2))})
    plot_recall_by_count(tmp_path / "none.png", "", {"best": nothing})
    assert cv2.imread(str(tmp_path / "none.png")) is not None
