from itertools import pairwise

import cv2
import numpy as np
from matplotlib.figure import Figure

from perception.render import measure_panels
from perception.render.measure_panels import Condition, plot_conditions, plot_groups

MEASURES = {
    "HOTA [%]": {"thesis": np.array([50.0, 40, 10]), "default": np.array([90.0, 90, 80])},
    "MOTA [%]": {"thesis": np.array([20.0, -40, -80]), "default": np.array([80.0, 80, 70])},
}


def drawn(monkeypatch) -> list[Figure]:
    """Keep the figures that are drawn from now on."""
    figures = []
    save = measure_panels.save_figure
    monkeypatch.setattr(
        measure_panels, "save_figure", lambda f, path: (figures.append(f), save(f, path))
    )
    return figures


def test_conditions_are_rows_and_measures_columns_of_one_scale(tmp_path, monkeypatch):
    figures, picture = drawn(monkeypatch), tmp_path / "new" / "curves.png"
    condition = Condition("error [m]", (0.0, 0.5, 1.0), MEASURES)
    plot_conditions(picture, "Curves", [condition, condition])
    assert cv2.imread(str(picture)).std() > 5
    panels = figures[0].axes
    assert [axes.get_title() for axes in panels] == ["HOTA [%]", "MOTA [%]"] * 2
    for axes in panels:
        np.testing.assert_array_equal(axes.lines[0].get_xdata(), [0, 0.5, 1])
        assert axes.get_ylim()[0] <= 0 < axes.get_ylim()[1]
    np.testing.assert_array_equal(panels[1].lines[0].get_ydata(), [20, -40, -80])
    assert panels[0].get_ylim() == panels[2].get_ylim()


def test_groups_have_a_bar_for_each_method(tmp_path, monkeypatch):
    figures, picture = drawn(monkeypatch), tmp_path / "bars.png"
    plot_groups(picture, "Bars", ["HDL-64E", "HDL-32E", "VLP-16"], MEASURES)
    assert cv2.imread(str(picture)).std() > 5
    bars = figures[0].axes[1].patches
    assert [bar.get_height() for bar in bars] == [20, -40, -80, 80, 80, 70]
    # Side by side, not over one another.
    places = sorted((bar.get_x(), bar.get_x() + bar.get_width()) for bar in bars)
    assert all(end <= begin + 1e-9 for (_, end), (begin, _) in pairwise(places))


def test_a_measure_of_nothing_leaves_a_gap(tmp_path):
    missing = {"HOTA [%]": {"thesis": np.full(2, np.nan), "default": np.array([1.0, 2])}}
    plot_groups(tmp_path / "bars.png", "Bars", ["a", "b"], missing)
    plot_conditions(tmp_path / "curves.png", "Curves", [Condition("error", (0, 1), missing)])
    assert (tmp_path / "curves.png").is_file()
