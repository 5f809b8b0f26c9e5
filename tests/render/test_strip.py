import cv2
import numpy as np
import pytest

from perception.render.canvas import Align, text_width_px
from perception.render.palette import FAINT_TEXT, PANEL, STAGES, STATIC
from perception.render.strip import draw_stage_bar, draw_worker_bars
from perception.types import StageSpan

BAR_ROW = 20


@pytest.fixture
def canvas():
    return np.zeros((60, 1000, 3), np.uint8)


def test_a_stage_is_as_long_as_its_share_of_a_turn(canvas):
    draw_stage_bar(canvas, {"registration": 0.020, "ground": 0.010}, period_s=0.1, text_px=9)
    bar = canvas[BAR_ROW]
    assert (bar[:200] == STAGES[0]).all()
    assert (bar[200:300] == STAGES[1]).all()
    assert (bar[300:998] == PANEL).all()
    assert (bar[998:] == FAINT_TEXT).all()


def test_a_late_frame_shows_where_the_turn_ended(canvas):
    draw_stage_bar(canvas, {"registration": 0.120, "ground": 0.080}, period_s=0.1, text_px=9)
    bar = canvas[BAR_ROW]
    assert (bar[498:500] == STATIC).all()
    assert (bar[500:600] == STAGES[0]).all()
    assert (bar[600:] == STAGES[1]).all()


def test_more_stages_than_colours_are_drawn(canvas):
    draw_stage_bar(canvas, {f"stage {n}": 0.005 for n in range(12)}, period_s=0.1, text_px=9)
    assert (canvas[BAR_ROW, 550:600] == STAGES[11 % len(STAGES)]).all()


def test_each_worker_has_a_bar_of_its_own(canvas):
    spans = [
        StageSpan("registration", "above", 0.010, 0.030),
        StageSpan("maps", "below", 0.020, 0.050),
    ]
    draw_worker_bars(canvas, spans, period_s=0.1, text_px=9)
    above, below = canvas[13], canvas[20]
    assert (above[100:300] == STAGES[0]).all()
    assert (below[200:500] == STAGES[1]).all()
    assert (above[300:990] == PANEL).all()
    assert (below[:200] == PANEL).all()


def test_no_stage_is_an_empty_bar(canvas):
    draw_worker_bars(canvas, [], period_s=0.1, text_px=9)
    assert (canvas[BAR_ROW, :998] == PANEL).all()


@pytest.mark.skipif(cv2.__version__ < "5", reason="letters of OpenCV 4 are wider")
@pytest.mark.parametrize("width", [1000, 500, 150])
def test_names_of_stages_neither_overlap_nor_run_out(canvas, width, monkeypatch):
    written = []

    def draw_text(canvas, text, position_px, *, color, height_px, align=Align.LEFT):
        left = position_px[0] - text_width_px(text, height_px) * align.value
        written.append((position_px[1], left, left + text_width_px(text, height_px)))

    monkeypatch.setattr("perception.render.strip.draw_text", draw_text)
    spans = [StageSpan(f"stage {n}", "", 0.01 * n, 0.01 * n + 0.005) for n in range(11)]
    draw_worker_bars(canvas[:, :width], spans, period_s=0.1, text_px=9)
    lines = sorted({baseline for baseline, _, _ in written})
    assert len(lines) == (1 if width == 1000 else 2)
    assert (len(written) == 12) == (width >= 500)
    assert lines[-1] < 60
    for line in lines:
        edges = [
            edge for baseline, *extent in sorted(written) if baseline == line for edge in extent
        ]
        assert edges == sorted(edges)
        assert edges[0] >= 0
        assert edges[-1] <= width
