"""Figures of what a tracker of one object does in one frame."""

from pathlib import Path

from perception.render.color_model_plots import ColorModelScene, plot_color_model
from perception.render.localization_plots import (
    GroundRemovalScene,
    PointMeanShiftScene,
    plot_ground_removal,
    plot_point_mean_shift,
)
from perception.render.tracked_object_views import TrackedObjectScene
from perception.tracking.single_object.centroid_tracker import CentroidTracker
from perception.tracking.single_object.fusion.fusion_tracker import FusionTracker
from perception.tracking.single_object.pitch_ground import PitchedPlane
from perception.tracking.single_object.tracker import SingleObjectTracker


def plot_tracker(
    folder: Path, title: str, tracker: SingleObjectTracker, scene: TrackedObjectScene
) -> None:
    """Plot the stages that a tracker has: ground (Fig. 5.14), mean shift (5.15), colour model (5.16).

    Args:
        folder: Folder for the figures.
        title: Object and frame.
        tracker: Tracker after the frame.
        scene: Object in the frame.
    """
    if isinstance(tracker, CentroidTracker):
        _plot_localization(folder, title, tracker, scene)
    image, region = scene.result.frame.image, scene.tracked.region
    if isinstance(tracker, FusionTracker) and image is not None and region is not None:
        colors = tracker.colors
        model = ColorModelScene(image, colors.regions, colors.measured, colors.colors.ratios)
        plot_color_model(folder / "color-model.png", f"Colours of {title}", model)


def _plot_localization(
    folder: Path, title: str, tracker: CentroidTracker, scene: TrackedObjectScene
) -> None:
    found, box_velo = tracker.localizer_input, scene.tracked.box_velo
    if found is None or box_velo is None:
        return
    if isinstance(found.ground, PitchedPlane):
        removal = GroundRemovalScene(
            found.tracker_input.points_velo,
            found.ground,
            tracker.pitch.gate_rad,
            tracker.config.pitch,
            tracker.config.min_height_m,
            box_velo,
            found.tracker_input.image,
            found.tracker_input.image_P_velo,
        )
        plot_ground_removal(folder / "ground.png", f"Ground below {title}", removal)
    if tracker.localizer.windows:
        shift = PointMeanShiftScene(
            found.obstacles.points_world, tracker.localizer.windows, float(box_velo.size_m[0, 2])
        )
        plot_point_mean_shift(folder / "mean-shift.png", f"Mean shift to {title}", shift)
