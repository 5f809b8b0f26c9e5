import cv2
import numpy as np

from perception.render.precision_plots import PrecisionPanel, plot_precision


def test_a_panel_a_class_with_its_curves(tmp_path):
    low, high = np.linspace(0.5, 0, 41), np.linspace(1, 0.6, 41)
    path = tmp_path / "made" / "precision.png"
    panels = [PrecisionPanel("Car", {"easy": high, "hard": low}), PrecisionPanel("Tram", {})]
    plot_precision(path, "three classes", panels)
    image = cv2.imread(str(path))
    assert list(path.parent.iterdir()) == [path]
    height, width = image.shape[:2]
    assert width > 1.5 * height
    saturation = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)[..., 1] > 80
    # Two coloured curves on the left; on the right, where nothing was detected, only words.
    assert saturation[:, : width // 2].sum() > 1000
    assert saturation[:, 6 * width // 10 :].sum() == 0
