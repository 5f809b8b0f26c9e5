import cv2
import numpy as np

from perception.render.success_plots import SuccessPanel, plot_success


def panel(**curves: np.ndarray) -> SuccessPanel:
    return SuccessPanel("all", "frames", 1.0, "share", curves, dict.fromkeys(curves, "0.5"))


def test_panels_wrap_after_three_and_what_is_missing_is_said(tmp_path):
    path = tmp_path / "made" / "success.png"
    low, high = np.linspace(0, 0.3, 9), np.linspace(0, 1, 150)
    panels = [panel(one=low, other=high), panel(one=low), panel(other=high), panel()]
    plot_success(path, "four groups", panels)
    assert list(path.parent.iterdir()) == [path]
    image = cv2.imread(str(path))
    height, width = image.shape[:2]
    saturation = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)[..., 1] > 80
    upper, lower = saturation[: height // 2], saturation[height // 2 :]
    columns = [upper[:, k * width // 3 : (k + 1) * width // 3].sum() for k in range(3)]
    assert min(columns) > 500
    assert columns[0] > 1.5 * min(columns[1:])  # two curves
    assert lower.sum() == 0  # one panel without frames, two places without a panel


def test_a_name_keeps_its_colour_where_another_is_missing(tmp_path):
    hues = []
    for number, panels in enumerate([[panel(a=np.zeros(3), b=np.ones(3))], [panel(b=np.ones(3))]]):
        path = tmp_path / f"{number}.png"
        plot_success(path, "", [panel(a=np.full(3, np.nan)), *panels])
        image = cv2.imread(str(path))
        right = image[:, image.shape[1] // 2 :]
        hsv = cv2.cvtColor(right, cv2.COLOR_BGR2HSV)
        hues.append(set(np.unique(hsv[..., 0][hsv[..., 1] > 100]).tolist()))
    assert hues[1] & hues[0]
