"""Results that fit the labels of another frame are noticed, those of trackers with errors are not."""

import numpy as np
import pytest

from perception.evaluation.frame_numbering import NumberingFit, numbering_fit, numbering_notes

FRAMES = np.repeat(np.arange(10), 2)
# Two cars that move by 20 px a frame, to the right and to the left.
LEFT = np.stack([100 + 20 * np.arange(10), 900 - 20 * np.arange(10)], axis=1).ravel()
BOXES = np.stack([LEFT, np.full(20, 50), LEFT + 60, np.full(20, 90)], axis=1).astype(np.float64)


def fit(shift: int, boxes: np.ndarray = BOXES) -> NumberingFit:
    return numbering_fit(FRAMES, BOXES, FRAMES + shift, boxes)


def test_the_fit_at_each_offset():
    own = fit(0)
    assert (own.rows, own.offset) == (20, 0)
    assert own.better.tolist() == [0, 0, 0]
    # 40 of 80 px beside the neighbour in 9 of 10 frames.
    np.testing.assert_allclose(own.iou_sum, [20, 9, 9])


@pytest.mark.parametrize(("shift", "reason"), [(1, "k-1"), (-1, "k+1")])
def test_one_frame_off(shift, reason):
    assert fit(shift).offset == -shift
    (note,) = numbering_notes({"0000": fit(shift), "0001": fit(0), "0007": fit(shift)})
    assert note.startswith(
        f"0000, 0007: 100 % of 40 rows fit the labels of frame {reason} better than those of their own frame k, "
        "IoU 1.00 instead of 0.45:"
    )
    assert note.endswith("They are scored as they stand.")


def test_two_frames_off_are_not_one():
    assert fit(2).offset == -1  # nearer by one, and said so
    assert fit(5).offset == 0


def test_errors_of_detectors_are_not_another_numbering():
    rng = np.random.default_rng(0)
    assert fit(0, BOXES + rng.normal(0, 8, BOXES.shape)).offset == 0
    assert numbering_notes({"0000": fit(0)}) == []


def test_static_objects_do_not_tell_the_numbering():
    standing = np.tile(BOXES[:2], (10, 1))
    assert numbering_fit(FRAMES, standing, FRAMES + 1, standing).offset == 0


def test_few_rows_may_be_chance():
    found = numbering_fit(FRAMES, BOXES, FRAMES[:8] + 1, BOXES[:8])
    assert (found.rows, found.better.tolist(), found.offset) == (8, [0, 8, 0], 0)


def test_without_rows_no_numbering_fits():
    none = np.zeros(0, np.int64)
    assert numbering_fit(none, np.zeros((0, 4)), FRAMES, BOXES).offset == 0
    assert numbering_fit(FRAMES, BOXES, none, np.zeros((0, 4))).offset == 0
    assert numbering_notes({}) == []


def test_labels_may_be_in_any_order():
    order = np.random.default_rng(1).permutation(20)
    shuffled = numbering_fit(FRAMES[order], BOXES[order], FRAMES + 1, BOXES)
    assert shuffled.iou_sum.tolist() == fit(1).iou_sum.tolist()


def test_of_many_rows_some_are_compared():
    frames = np.repeat(np.arange(500), 20)
    left = 40.0 * frames + np.tile(100.0 * np.arange(20), 500)
    boxes = np.stack([left, np.zeros(10_000), left + 60, np.full(10_000, 40)], axis=1)
    found = numbering_fit(frames, boxes, frames - 1, boxes)
    assert found.rows <= 2000
    assert found.better[2] / found.rows == pytest.approx(1, abs=0.01)
    assert found.offset == 1
