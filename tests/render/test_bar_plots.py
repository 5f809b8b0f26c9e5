from itertools import pairwise

import cv2
import numpy as np
from matplotlib.figure import Figure

from perception.render import bar_plots
from perception.render.bar_plots import plot_groups, plot_timeline
from perception.types import StageSpan


def test_a_timeline_is_an_image_with_a_row_for_each_worker(tmp_path):
    spans = [
        StageSpan("registration", "obstacles", 0.0, 0.03),
        StageSpan("maps", "vehicles", 0.0, 0.01),
        StageSpan("detectors", "vehicles", 0.01, 0.012),
    ]
    for count in (1, 3):
        plot_timeline(tmp_path / f"{count}.png", "a frame", spans[:count], period_s=0.1)
    one, two = (cv2.imread(str(tmp_path / f"{count}.png")) for count in (1, 3))
    assert two.shape[0] > one.shape[0]
    assert two.shape[1] == one.shape[1]


def test_words_stay_within_their_bar_or_stand_above_it_apart(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(bar_plots, "save_figure", lambda figure, path: drawn.append(figure))
    spans = [
        StageSpan("static and moving", "obstacles", 0.0, 0.1),
        StageSpan("moving objects", "obstacles", 0.1, 0.102),
        StageSpan("ground", "obstacles", 0.103, 0.105),
        StageSpan("rgb detector", "detectors_0", 0.103, 0.105),
    ]
    plot_timeline(tmp_path / "none.png", "a frame", spans, period_s=0.1)
    (axes,) = drawn[0].axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["obstacles", "detectors"]
    bars = [bar.get_window_extent() for bar in axes.patches]
    words = {text.get_text(): text.get_window_extent() for text in axes.texts}
    inside = words.pop("static and moving\n100.0")
    assert bars[0].x0 < inside.x0 < inside.x1 < bars[0].x1
    assert bars[0].y0 < inside.y0 < inside.y1 < bars[0].y1
    above = [words[name] for name in ("moving objects 2.0", "ground 2.0", "rgb detector 2.0")]
    for place, bar in zip(above, bars[1:], strict=True):
        assert place.y0 >= bar.y1 - 1
        assert place.x1 <= axes.get_window_extent().x1
    assert not above[0].overlaps(above[1])


METRICS = {
    "HOTA [%]": {"thesis": np.array([50.0, 40, 10]), "default": np.array([90.0, 90, 80])},
    "MOTA [%]": {"thesis": np.array([20.0, -40, -80]), "default": np.array([80.0, 80, 70])},
}


def test_groups_have_a_bar_for_each_method(tmp_path, monkeypatch):
    figures: list[Figure] = []
    save = bar_plots.save_figure
    monkeypatch.setattr(
        bar_plots, "save_figure", lambda f, path: (figures.append(f), save(f, path))
    )
    plot_groups(tmp_path / "bars.png", "Bars", ["HDL-64E", "HDL-32E", "VLP-16"], METRICS)
    assert cv2.imread(str(tmp_path / "bars.png")).std() > 5
    bars = figures[0].axes[1].patches
    assert [bar.get_height() for bar in bars] == [20, -40, -80, 80, 80, 70]
    # Side by side, not over one another.
    positions = sorted((bar.get_x(), bar.get_x() + bar.get_width()) for bar in bars)
    assert all(end <= begin + 1e-9 for (_, end), (begin, _) in pairwise(positions))


def test_a_metric_that_is_not_known_leaves_a_gap(tmp_path):
    missing = {"HOTA [%]": {"thesis": np.full(2, np.nan), "default": np.array([1.0, 2])}}
    plot_groups(tmp_path / "bars.png", "Bars", ["a", "b"], missing)
    assert (tmp_path / "bars.png").is_file()
