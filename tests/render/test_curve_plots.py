import cv2
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from perception.evaluation.detection.proposal_recall import ProposalRecall, RecallMetrics
from perception.render.curve_plots import (
    Curve,
    CurvePanel,
    curve_figure,
    metric_panels,
    plot_curves,
    precision_panel,
    recall_by_count_panels,
    recall_by_iou_panels,
    tracking_error_panel,
)

METRICS = {
    "HOTA [%]": {"thesis": np.array([50.0, 40, 10]), "default": np.array([90.0, 90, 80])},
    "MOTA [%]": {"thesis": np.array([20.0, -40, -80]), "default": np.array([80.0, 80, 70])},
}


def panel(**curves: np.ndarray) -> CurvePanel:
    listed = [Curve.evenly_spaced(name, values, note="0.5") for name, values in curves.items()]
    return CurvePanel("all", "frames", "share", listed, (0, 1), (0, 1))


def recall(reached: int) -> ProposalRecall:
    ranks = np.array([*range(reached), *[-1] * (8 - reached)])
    some = RecallMetrics(8, {0.7: ranks, 0.5: ranks}, np.where(ranks < 0, 0.2, 0.8))
    none = RecallMetrics(0, {0.7: ranks[:0], 0.5: ranks[:0]}, np.zeros(0))
    return ProposalRecall(2, 20, 12, {"easy": some, "hard": none})


def texts(axes) -> list[str]:
    return [text.get_text() for text in axes.texts]


def test_precision_is_drawn_over_recall_and_a_class_without_detections_says_so(tmp_path):
    low, high = np.linspace(0.5, 0, 41), np.linspace(1, 0.6, 41)
    path = tmp_path / "made" / "precision.png"
    panels = [precision_panel("Car", {"easy": high, "hard": low}), precision_panel("Tram", {})]
    plot_curves(path, "two classes", panels)
    assert list(path.parent.iterdir()) == [path]
    image = cv2.imread(str(path))
    height, width = image.shape[:2]
    assert width > 1.5 * height
    saturation = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)[..., 1] > 80
    assert saturation[:, : width // 2].sum() > 1000
    assert saturation[:, 6 * width // 10 :].sum() == 0
    car, tram = curve_figure("two classes", panels).axes
    assert [line.get_xdata()[-1] for line in car.lines] == [1.0, 1.0]
    assert texts(tram) == ["nothing detected"]


def test_panels_wrap_and_a_panel_without_curves_says_so():
    low, high = np.linspace(0, 0.3, 9), np.linspace(0, 1, 150)
    panels = [panel(one=low, other=high), panel(one=low), panel(other=high), panel()]
    axes = curve_figure("four groups", panels, columns=3).axes
    assert [len(one.lines) for one in axes] == [2, 1, 1, 0, 0, 0]
    assert [one.axison for one in axes] == [True] * 4 + [False] * 2
    assert texts(axes[3]) == ["no frames"]


def test_a_name_keeps_its_colour_where_another_is_missing():
    panels = [panel(a=np.zeros(3), b=np.ones(3)), panel(b=np.ones(3))]
    both, alone = curve_figure("", panels).axes
    assert both.lines[1].get_color() == alone.lines[0].get_color() != both.lines[0].get_color()


def test_panels_of_the_same_curves_share_one_legend():
    alike, different = [panel(a=np.ones(3))] * 2, [panel(a=np.ones(3)), panel(b=np.ones(3))]
    figure = curve_figure("", alike)
    assert len(figure.legends) == 1
    assert [axes.get_legend() for axes in figure.axes] == [None, None]
    figure = curve_figure("", different)
    assert not figure.legends
    assert all(axes.get_legend() is not None for axes in figure.axes)


@pytest.mark.parametrize("columns", [1, 2, 3])
def test_legends_hide_no_curve(columns):
    panels = [
        panel(**{f"difficulty {n}": np.linspace(1, 0, 5) for n in range(count)})
        for count in (1, 5, 3, 2)
    ]
    figure = curve_figure("all", panels, columns=columns)
    FigureCanvasAgg(figure).draw()
    areas = [axes.get_window_extent() for axes in figure.axes]
    legends = [axes.get_legend().get_window_extent() for axes in figure.axes if axes.get_legend()]
    assert len(legends) == 4
    assert not any(legend.overlaps(area) for legend in legends for area in areas)
    assert all(figure.bbox.containsx(box.x0) and figure.bbox.containsy(box.y0) for box in legends)


def test_conditions_are_rows_and_metrics_columns_of_one_scale():
    row = metric_panels("error [m]", (0.0, 0.5, 1.0), METRICS)
    panels = curve_figure("Curves", [*row, *row], columns=2, share_y="col").axes
    assert [axes.get_title() for axes in panels] == ["HOTA [%]", "MOTA [%]"] * 2
    for axes in panels:
        np.testing.assert_array_equal(axes.lines[0].get_xdata(), [0, 0.5, 1])
        assert axes.get_ylim()[0] <= 0 < axes.get_ylim()[1]
    np.testing.assert_array_equal(panels[1].lines[0].get_ydata(), [20, -40, -80])
    assert panels[0].get_ylim() == panels[2].get_ylim()


def test_a_shared_scale_holds_the_largest_values_of_all_panels():
    small, large = (panel(a=np.full(3, top)) for top in (1.0, 7.0))
    free = [CurvePanel("", "", "", one.curves) for one in (small, large, small)]
    for axes in curve_figure("", free, share_y="all").axes:
        assert axes.get_ylim()[0] == 0
        assert axes.get_ylim()[1] >= 7


def test_values_that_are_not_known_leave_a_gap(tmp_path):
    missing = {"HOTA [%]": {"thesis": np.full(2, np.nan), "default": np.array([1.0, 2])}}
    plot_curves(tmp_path / "curves.png", "Curves", metric_panels("error", (0, 1), missing))
    assert cv2.imread(str(tmp_path / "curves.png")).std() > 5


def test_a_lost_track_does_not_stretch_the_scale_of_tracking_errors():
    times_s = np.arange(5) / 10
    hidden = np.array([False, True, True, False, False])
    errors = {"good": np.full(5, 0.1), "gone": np.array([0.1, 50, 60, np.nan, 70])}
    panels = [tracking_error_panel(f"scene {n}", times_s, hidden, errors) for n in range(5)]
    axes = curve_figure("title", panels, columns=4, share_y="all").axes
    assert [len(one.lines) for one in axes] == [2] * 5 + [0] * 3
    assert axes[0].get_ylim()[1] < 1
    assert len(axes[0].patches) == 2
    np.testing.assert_allclose(panels[0].shaded, [(0.05, 0.15), (0.15, 0.25)])


@pytest.mark.parametrize(
    ("panels_of", "rows"), [(recall_by_count_panels, 2), (recall_by_iou_panels, 1)]
)
def test_recall_has_a_column_for_each_difficulty(panels_of, rows):
    panels = panels_of({"best": recall(7), "thesis": recall(3)})
    assert [one.title.partition(":")[0] for one in panels] == ["easy", "hard"] * rows
    for easy, hard in zip(panels[::2], panels[1::2], strict=True):
        assert [curve.name for curve in easy.curves] == ["best", "thesis"]
        assert easy.curves[0].note.startswith("87.5 %")
        assert not hard.curves


def test_settings_without_any_proposal_are_drawn_too(tmp_path):
    nothing = ProposalRecall(1, 0, 0, {"all": RecallMetrics(2, {0.7: np.full(2, -1)}, np.zeros(2))})
    plot_curves(tmp_path / "none.png", "", recall_by_count_panels({"best": nothing}))
    assert cv2.imread(str(tmp_path / "none.png")) is not None


def test_curves_of_similar_colours_have_other_dashes():
    many = {f"tracker {number}": np.linspace(1, 0, 30) for number in range(8)}
    (axes, *_) = curve_figure("Fig. A.3", [panel(**many)]).axes
    third, seventh = axes.lines[2], axes.lines[6]
    assert third.get_linestyle() != seventh.get_linestyle()
    assert len({(str(line.get_linestyle()), line.get_color()) for line in axes.lines}) == 8
