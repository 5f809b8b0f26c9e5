import numpy as np
import pytest

from perception.render.labels import Label, draw_labels, place_tags
from perception.render.palette import STATIC, TEXT

CANVAS_PX = (300, 200)
TITLE_PX = np.array([0, 0, 90, 24])


def overlap_counts(tags_px, size_px=CANVAS_PX):
    counts = np.zeros(size_px[::-1], int)
    for left, top, right, bottom in tags_px:
        counts[top:bottom, left:right] += 1
    return counts


@pytest.mark.parametrize("seed", range(5))
def test_no_two_tags_overlap_all_are_on_the_canvas_and_the_first_is_placed(seed):
    random = np.random.default_rng(seed)
    corners = random.uniform((-40, -40), (300, 200), (60, 2))
    boxes = np.hstack([corners, corners + random.uniform(5, 120, (60, 2))])
    boxes[0] = (140, 80, 170, 110)
    sizes = np.column_stack([random.integers(20, 80, 60), np.full(60, 15)])
    tags = place_tags(boxes, sizes, CANVAS_PX, [TITLE_PX])
    placed = tags[tags[:, 2] > tags[:, 0]]
    assert 8 < len(placed) < 60
    assert placed.min() >= 0
    assert (placed[:, 2:] <= CANVAS_PX).all()
    assert overlap_counts([TITLE_PX, *placed]).max() == 1
    np.testing.assert_array_equal(placed[:, 2:] - placed[:, :2], sizes[tags[:, 2] > tags[:, 0]])
    assert tags[0].any()
    np.testing.assert_array_equal(place_tags(boxes, sizes, CANVAS_PX, [TITLE_PX]), tags)


@pytest.mark.parametrize(
    "box",
    [(-50, -50, 20, 20), (290, 190, 400, 400), (-9, -9, 400, 300), (100, 90, 101, 91)],
    ids=["upper left corner", "lower right corner", "whole canvas", "one pixel"],
)
def test_the_first_tag_is_placed_wherever_its_box_is(box):
    (tag,) = place_tags(np.array([box], float), np.array([[80, 15]]), CANVAS_PX, [TITLE_PX])
    assert tag.any()
    assert overlap_counts([TITLE_PX, tag]).max() == 1


def test_a_tag_stands_over_its_box_else_where_it_covers_no_other_box():
    boxes = np.array([[100.0, 100, 140, 130], [90, 70, 150, 98]])
    first, second = place_tags(boxes, np.full((2, 2), (40, 16)), CANVAS_PX)
    assert first[1] >= 130
    np.testing.assert_array_equal(second, [100, 50, 140, 66])


def test_a_box_out_of_view_and_a_tag_wider_than_the_canvas_are_left_out():
    boxes = np.array([[np.inf, np.inf, -np.inf, -np.inf], [310, 20, 340, 60], [10, 50, 60, 90]])
    sizes = np.array([[40, 15], [40, 15], [400, 15]])
    assert not place_tags(boxes, sizes, CANVAS_PX).any()


def test_a_label_has_the_colour_of_its_object_and_the_first_takes_the_best_place():
    canvas = np.full((200, 300, 3), 200, np.uint8)
    box = np.array([100.0, 100, 200, 150])
    draw_labels(canvas, [Label(box, "Car #4", STATIC, "97%"), Label(box, "#5", TEXT)], 9)
    above, below = canvas[70:99], canvas[152:180]
    assert (above == STATIC).all(axis=2).any()
    assert not (below == STATIC).all(axis=2).any()
    assert (below < 100).any()
