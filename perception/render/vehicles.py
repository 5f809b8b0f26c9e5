"""Detected vehicles in images, in space, and in small panels of the maps that detectors use."""

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from perception.detection.config import DetectionConfig
from perception.render import palette
from perception.render.canvas import draw_tag
from perception.render.detections import draw_boxes
from perception.render.palette import Color
from perception.render.panels import Resizing
from perception.render.track_figures import TrackFigures, track_figures
from perception.render.tracks import TrackStyle, draw_track_figures
from perception.types import (
    MAP_MODALITIES,
    Bool,
    Detections,
    Float64,
    Int,
    MapModality,
    Modality,
    Result,
    Tracks,
    UInt8,
    Vehicles,
)

_SKY_SHARE = 0.25  # top of a map that is cut off: a LiDAR has no returns from the sky
_TITLES: dict[MapModality, str] = {"dm": "Depth map", "rm": "Reflectance map"}


@dataclass(frozen=True)
class VehicleFigures:
    """Vehicles of one frame as they are drawn.

    Attributes:
        modality_boxes_px: (K, 4) boxes x1 y1 x2 y2 of each modality's detector in the image.
        ids: (M,) track ids of the fused detections, -1 of those without a track.
        boxes_px: (M, 4) boxes x1 y1 x2 y2 of the fused detections in the image.
        distances_m: (M,) distances from the LiDAR in metres, NaN where unknown.
        speeds_m_s: (M,) speeds over ground in metres per second, NaN where unknown.
        figures: 3D boxes of the vehicles that have one and are not drawn as tracks.
        names: Labels of `figures`, in its order.
    """

    modality_boxes_px: dict[Modality, Float64]
    ids: Int
    boxes_px: Float64
    distances_m: Float64
    speeds_m_s: Float64
    figures: TrackFigures
    names: tuple[str, ...]

    @classmethod
    def of(
        cls, result: Result, display_score: float = DetectionConfig.display_score
    ) -> Self | None:
        """Select the detections of a frame that are drawn; None where no detector ran.

        Args:
            result: Output of the pipeline.
            display_score: Score from which a detection is drawn.
        """
        vehicles = result.vehicles
        if vehicles is None:
            return None
        shown: Bool = np.asarray(vehicles.fused.detections.scores >= display_score)
        tracks = _as_tracks(vehicles, shown, result.tracks.ids)
        figures = track_figures(tracks, list(tracks.boxes.bottom_m[:, None]))
        return cls(
            {
                modality: displayed_boxes_px(found, display_score)
                for modality, found in result.modality_detections.items()
            },
            vehicles.ids[shown],
            vehicles.fused.detections.boxes_px[shown],
            vehicles.distances_m[shown],
            np.hypot(*vehicles.velocities_m_s.T)[shown],
            figures,
            tuple(_name(track) for track in figures.tracks.ids.tolist()),
        )

    def draw_on_image(self, canvas: UInt8, resizing: Resizing, style: TrackStyle) -> None:
        """Draw the boxes of each modality in thin lines and the fused ones in bold lines with labels."""
        for modality, modality_boxes_px in self.modality_boxes_px.items():
            color = palette.MODALITIES[modality]
            draw_boxes(canvas, resizing.move_boxes(modality_boxes_px), color)
        boxes_px = resizing.move_boxes(self.boxes_px)
        for row in range(len(boxes_px)):
            color = _color(int(self.ids[row]))
            draw_boxes(canvas, boxes_px[row : row + 1], color, style.line_px + 1)
        for row, box_px in enumerate(boxes_px):
            draw_tag(canvas, self._label(row), box_px, _color(int(self.ids[row])), style.text_px)

    def draw_in_space(self, canvas: UInt8, image_P_velo: Float64, style: TrackStyle) -> None:
        """Draw the 3D boxes of the vehicles that are not drawn as tracks, with their labels."""
        if not self.names:
            return
        colors = [_color(track) for track in self.figures.tracks.ids.tolist()]
        outlines = draw_track_figures(canvas, image_P_velo, self.figures, colors, style)
        for name, outline, color in zip(self.names, outlines, colors, strict=True):
            draw_tag(canvas, name, outline, color, style.text_px)

    def _label(self, row: int) -> str:
        """Return track id, distance and speed, as far as they are known."""
        parts = [str(self.ids[row])] if self.ids[row] >= 0 else []
        for value, unit in (
            (self.distances_m[row], "{:.0f} m"),
            (self.speeds_m_s[row], "{:.1f} m/s"),
        ):
            if np.isfinite(value):
                parts.append(unit.format(value))
        return "  ".join(parts) or "car"


def displayed_boxes_px(detections: Detections, display_score: float) -> Float64:
    """Return the (K, 4) boxes of the detections from a score on."""
    return detections.boxes_px[detections.scores >= display_score]


def map_panels(
    result: Result,
    largest_px: tuple[int, int],
    display_score: float = DetectionConfig.display_score,
) -> dict[str, UInt8]:
    """Return the maps that detectors used as small images by title, with the detections in them.

    Args:
        result: Output of the pipeline.
        largest_px: (width, height) that each image has at most.
        display_score: Score from which a detection is drawn.
    """
    panels = {}
    for modality in (name for name in MAP_MODALITIES if name in result.map_images):
        values = result.map_images[modality]
        scale = min(largest_px[0] / values.shape[1], largest_px[1] / values.shape[0])
        image: UInt8 = np.asarray(
            cv2.applyColorMap(_shrink(values, scale), _COLORS[modality]), np.uint8
        )
        # Centres of pixels are whole numbers, as in `Resizing`.
        found_px = displayed_boxes_px(result.modality_detections[modality], display_score)
        draw_boxes(image, (found_px + 0.5) * scale - 0.5, palette.MODALITIES[modality])
        panels[_TITLES[modality]] = image[round(_SKY_SHARE * len(image)) :]
    return panels


def _shrink(values: UInt8, scale: float) -> UInt8:
    """Take the nearest pixel: a mean of known and unknown pixels has no meaning."""
    size_px = (round(values.shape[1] * scale), round(values.shape[0] * scale))
    return np.asarray(cv2.resize(values, size_px, interpolation=cv2.INTER_NEAREST), np.uint8)


def _color_table(color_map: int, *, is_reversed: bool) -> UInt8:
    """Return the (256, 1, 3) colour of each value; of 0, unknown, the colour of a panel."""
    values = np.arange(256, dtype=np.uint8)[:, None]
    shown = cv2.applyColorMap(255 - values if is_reversed else values, color_map)
    table: UInt8 = np.asarray(shown[:, :, ::-1], np.uint8).copy()
    table[0] = palette.PANEL
    return table


# Near is bright, as in the thesis' figures.
_COLORS: dict[MapModality, UInt8] = {
    "dm": _color_table(cv2.COLORMAP_TURBO, is_reversed=True),
    "rm": _color_table(cv2.COLORMAP_BONE, is_reversed=False),
}


def _as_tracks(vehicles: Vehicles, shown: Bool, drawn_ids: Int) -> Tracks:
    """Return the vehicles that have a 3D box and are not drawn as a track of the same id."""
    is_located = np.isfinite(vehicles.boxes.bottom_m).all(axis=1)
    is_drawn = (vehicles.ids >= 0) & np.isin(vehicles.ids, drawn_ids)
    rows = np.flatnonzero(shown & is_located & ~is_drawn)
    detections = vehicles.fused.detections[rows]
    return Tracks(
        vehicles.ids[rows],
        vehicles.boxes[rows],
        np.nan_to_num(vehicles.velocities_m_s[rows]),
        np.ones(len(rows), bool),
        vehicles.covariances[rows],
        detections.types,
        detections.scores,
    )


def _name(track: int) -> str:
    return str(track) if track >= 0 else "car"


def _color(track: int) -> Color:
    return palette.track_color(track) if track >= 0 else palette.TEXT
