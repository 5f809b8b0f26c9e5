"""The result of a frame of several cameras as each of them shows it."""

from dataclasses import replace

import numpy as np

from perception.geometry.camera import box_outlines_px
from perception.maps.projection import camera_of
from perception.types import Frame, Result, Vehicles


def views_of(result: Result) -> tuple[Result, ...]:
    """Return the result as each camera of its frame shows it, the main one first: one of a frame with that camera alone.

    Vehicles are those in the image. The box in the image of one that another camera shows better is the outline of its
    3D box, and comes from no detector.
    """
    return tuple(view_of(result, camera) for camera in range(len(result.frame.views)))


def view_of(result: Result, camera: int) -> Result:
    """Return one of these, by the number of its camera in `Frame.views`."""
    is_alone = not result.frame.further_cameras
    if is_alone and (result.vehicles is None or not result.vehicles.cameras.any()):
        return result
    view = replace(result.frame.views[camera], further_cameras=())
    is_main = camera == 0
    return replace(
        result,
        frame=view,
        modality_detections=result.detections_in(camera)
        if is_alone or result.further_detections
        else {},
        map_images=result.map_images if is_main else {},
        depthcn=result.depthcn if is_main else None,
        vehicles=None if result.vehicles is None else _vehicles_in(result.vehicles, view, camera),
        further_detections=(),
    )


def _vehicles_in(vehicles: Vehicles, view: Frame, camera: int) -> Vehicles:
    calibration, size_px = camera_of(view)
    outlines_px = box_outlines_px(calibration.image_P_velo, vehicles.boxes, size_px)
    is_own = vehicles.cameras == camera
    fused = vehicles.fused
    boxes_px = np.where(is_own[:, None], fused.detections.boxes_px, outlines_px)
    own = replace(
        vehicles,
        fused=replace(
            fused,
            detections=replace(fused.detections, boxes_px=boxes_px),
            source_indices=np.where(is_own[:, None], fused.source_indices, -1),
        ),
        cameras=np.zeros(len(vehicles), np.int64),
    )
    return own.select(np.flatnonzero(np.isfinite(boxes_px).all(axis=1)))
