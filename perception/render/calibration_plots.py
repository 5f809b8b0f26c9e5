"""Figure of a calibration: edges of a scan on the image, as the drive states their place and as it was found."""

from pathlib import Path

import numpy as np

from perception.calibration.frame_edges import FrameEdges
from perception.calibration.recalibration import Recalibration
from perception.geometry.camera import project
from perception.geometry.se3 import inverse
from perception.render import palette
from perception.render.figure import new_figure, save_figure
from perception.types import Calibration, UInt8

_WIDTH_IN, _TITLES_IN = 11.0, 0.9


def plot_recalibration(
    path: Path,
    title: str,
    image: UInt8,
    edges: FrameEdges,
    calibration: Calibration,
    found: Recalibration,
) -> None:
    """Draw the edges of one frame by the calibration that is stated and by the one that was found.

    Args:
        path: Path of the figure.
        title: Title of the figure.
        image: (H, W, 3) image of the frame.
        edges: Edges of the frame.
        calibration: Calibration that the drive states.
        found: Calibration that was found.
    """
    height, width = image.shape[:2]
    figure = new_figure(_WIDTH_IN, 2 * _WIDTH_IN * height / width + _TITLES_IN, title)
    panels = figure.subplots(2, 1)
    points_cam = edges.points_cam(found.turn)
    found_SE3_cam = found.cam_SE3_velo @ inverse(edges.cam_SE3_velo)
    moved_cam = points_cam @ found_SE3_cam[:3, :3].T + found_SE3_cam[:3, 3]
    rows = (
        (f"as stated: score {found.given_score:.3f}", points_cam),
        (f"as found: score {found.score:.3f}", moved_cam),
    )
    for axes, (name, points) in zip(panels, rows, strict=True):
        pixels, _ = project(calibration.image_P_cam, points)
        axes.imshow(image)
        for is_upright, color in ((True, palette.MOVING), (False, palette.TRACKS[0])):
            drawn = pixels[edges.scan.is_upright == is_upright]
            axes.scatter(drawn[:, 0], drawn[:, 1], s=3, color=np.divide(color, 255), linewidths=0)
        axes.set_title(name)
        axes.set_xlim(-0.5, width - 0.5)
        axes.set_ylim(height - 0.5, -0.5)
        axes.set_axis_off()
    save_figure(figure, path)
