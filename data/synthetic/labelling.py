"""Labels by KITTI's rules, from exact geometry, as a careful annotator draws them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from data.labelled_objects import labels_of_boxes
from data.synthetic.actors import Actor
from data.synthetic.raycasting import MovingObject, Rays, to_local
from data.synthetic.rig import PinholeCamera
from data.synthetic.world import World
from perception.geometry import se3
from perception.types import Bool, Boxes3D, Calibration, Float, Float64, Int, Labels

_SAMPLES = 26  # along each side of a box, at most, to tell what is visible
_EDGE_SAMPLES = 80  # the same where the image cuts an object off, to find its outline
_EDGE_POINTS = np.linspace(
    -0.5, 0.5, 33
)  # along each edge of a cuboid, so that the image may cut it
_LATTICE = np.stack(
    np.meshgrid(np.linspace(-0.45, 0.45, 9), np.linspace(-0.4, 0.4, 5), np.linspace(0.1, 0.9, 5)),
    -1,
).reshape(-1, 3)


@dataclass(frozen=True)
class LabelConfig:
    """Rules that tell labelled objects from DontCare regions.

    Attributes:
        min_height_px: Height in pixels below which an object is DontCare.
        unknown_height_px: Height in pixels below which the occlusion is 3, unknown.
        max_distance_m: Distance in metres beyond which an object is DontCare.
        min_visible_share: Visible share of the object within the image below which it is DontCare.
        visible_share: Visible share from which the occlusion is 0.
        partly_share: Visible share from which the occlusion is 1; below, it is 2.
        max_truncation: Share outside the image above which an object is DontCare.
        min_visible_px: Visible area in square pixels below which an object is not annotated at all.
    """

    min_height_px: float = 12.0
    unknown_height_px: float = 16.0
    max_distance_m: float = 85.0
    min_visible_share: float = 0.12
    visible_share: float = 0.85
    partly_share: float = 0.45
    max_truncation: float = 0.90
    min_visible_px: float = 30.0


@dataclass(frozen=True)
class _ImageObject:
    """One object before the camera.

    Attributes:
        actor: Actor.
        state: Pose and shape of the actor.
        box_px: (4,) box around its outline, cut at the image's edges.
        truncation: Share of its volume outside the image.
        distance_m: Distance along the camera's axis in metres.
    """

    actor: Actor
    state: MovingObject
    box_px: Float64
    truncation: float
    distance_m: float


def label(
    world: World,
    calibration: Calibration,
    world_SE3_velo: Float64,
    time_s: float,
    *,
    is_tracking: bool,
    config: LabelConfig = LabelConfig(),
) -> Labels:
    """Label the objects in the camera's view at a time.

    Args:
        world: World.
        calibration: Calibration of the camera.
        world_SE3_velo: (4, 4) pose of the LiDAR.
        time_s: Time in seconds.
        is_tracking: Whether truncation has the tracking benchmark's levels 0, 1 and 2 instead of a share.
        config: Rules of the annotation.
    """
    camera = PinholeCamera(calibration, world_SE3_velo)
    image_objects = _objects_in_image(world, camera, time_s, config)
    image_objects = [_cut_at_image(world, camera, image_object) for image_object in image_objects]
    alone, seen, area = _sample_visibility(world, camera, image_objects, time_s)
    share = seen / np.maximum(alone, 1)
    visible_px = share * area
    height = np.array([s.box_px[3] - s.box_px[1] for s in image_objects])
    truncation = np.array([s.truncation for s in image_objects])
    distance = np.array([s.distance_m for s in image_objects])
    noticed = (seen > 0) & (visible_px >= config.min_visible_px)
    labelled = noticed & (height >= config.min_height_px) & (distance <= config.max_distance_m)
    labelled &= (share >= config.min_visible_share) & (truncation <= config.max_truncation)
    occlusion = np.select([share >= config.visible_share, share >= config.partly_share], [0, 1], 2)
    occlusion = np.where(height < config.unknown_height_px, 3, occlusion)
    boxes_px = np.array([s.box_px for s in image_objects]).reshape(-1, 4)
    levels = np.digitize(truncation, [0.04, 0.5]).astype(float)
    kept = [
        image_object for image_object, keep in zip(image_objects, labelled, strict=True) if keep
    ]
    return Labels(
        boxes_velo=_boxes_velo(
            [s.state.world_SE3_object for s in kept],
            [s.actor.body.size_m for s in kept],
            world_SE3_velo,
        ),
        boxes_px=boxes_px[labelled],
        types=np.array([s.actor.body.kind for s in kept], np.str_),
        track_ids=np.array([s.actor.track_id for s in kept], np.int64),
        truncation=(levels if is_tracking else truncation)[labelled],
        occlusion=occlusion[labelled].astype(np.int64),
        dont_care_px=boxes_px[noticed & ~labelled],
    )


def _objects_in_image(
    world: World, camera: PinholeCamera, time_s: float, config: LabelConfig
) -> list[_ImageObject]:
    """Find the objects of which some part falls into the image."""
    found = []
    for actor in world.actors:
        if not world.is_near(actor, time_s, 1.4 * config.max_distance_m):
            continue
        state = world.state(actor, time_s)
        if not _may_be_in_view(actor, state, camera):
            continue
        image_object = _object_in_image(actor, state, _outline(actor, time_s), camera)
        if image_object is not None:
            found.append(image_object)
    return found


def _outline(actor: Actor, time_s: float) -> Float:
    """Return (V, 3) the points that the image box encloses.

    KITTI's boxes of vehicles are their 3D boxes as the camera sees them, cut at the image's edges: in its labelled
    frames all four sides agree within 0.3 % of the box, whatever is hidden. Those of people hold the body.
    """
    if actor.body.is_person:
        return actor.body.poses[actor.phase(time_s)].vertices_m
    return np.asarray(_CUBOID_EDGES * np.asarray(actor.body.size_m), np.float64)


def _cuboid_edges() -> Float64:
    """Return (V, 3) points on the twelve edges of a unit cuboid whose origin is its bottom centre."""
    signs = np.array([(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)])
    along = np.tile(_EDGE_POINTS, len(signs))
    across = signs.repeat(len(_EDGE_POINTS), axis=0)
    edges = [np.insert(across, axis, along, axis=1) for axis in range(3)]
    middle_to_bottom_m = np.array([0, 0, 0.5])
    return np.asarray(np.concatenate(edges) + middle_to_bottom_m, np.float64)


_CUBOID_EDGES = _cuboid_edges()


def _may_be_in_view(actor: Actor, state: MovingObject, camera: PinholeCamera) -> bool:
    """Return whether the sphere around an object reaches into the camera's field of view."""
    x, _, z = camera.camera_R_world @ (state.world_SE3_object[:3, 3] - camera.centre_m)
    radius = float(np.linalg.norm(actor.body.size_m))
    # Both sides of the image lie within 45 degrees of its axis.
    return bool(z > -radius and abs(x) < z + 1.5 * radius)


def _object_in_image(
    actor: Actor, state: MovingObject, outline: Float, camera: PinholeCamera
) -> _ImageObject | None:
    pose, width_height = state.world_SE3_object, np.array(camera.size_px, float)
    pixels, depth_m = camera.project(outline @ pose[:3, :3].T + pose[:3, 3])
    before = depth_m > 0.3
    if not before.any():
        return None
    low, high = pixels[before].min(axis=0), pixels[before].max(axis=0)
    low, high = np.maximum(low, 0.0), np.minimum(high, width_height - 1)
    if (high - low < 1.5).any():
        return None
    inside = _LATTICE * np.asarray(actor.body.size_m)
    places, depths = camera.project(inside @ pose[:3, :3].T + pose[:3, 3])
    with np.errstate(invalid="ignore"):
        is_in = ((places >= 0) & (places < width_height)).all(axis=1) & (depths > 0)
    middle = float(camera.project(pose[None, :3, 3])[1][0])
    return _ImageObject(actor, state, np.concatenate([low, high]), float(1 - is_in.mean()), middle)


def _cut_at_image(world: World, camera: PinholeCamera, image_object: _ImageObject) -> _ImageObject:
    """Shrink the box of a pedestrian at the image border to the part within the image."""
    if image_object.truncation == 0 or not image_object.actor.body.is_person:
        return image_object
    pixels, _ = _sample_pixels([image_object], _EDGE_SAMPLES)
    rays = camera.rays(pixels)
    inside = pixels[_covers(world, rays, np.arange(len(pixels)), image_object.state)]
    if len(inside) == 0:
        return image_object
    half_step = (image_object.box_px[2:] - image_object.box_px[:2]) / _EDGE_SAMPLES / 2
    low = np.maximum(inside.min(axis=0) - half_step, image_object.box_px[:2])
    high = np.minimum(inside.max(axis=0) + half_step, image_object.box_px[2:])
    return replace(image_object, box_px=np.concatenate([low, high]))


def _sample_visibility(
    world: World, camera: PinholeCamera, image_objects: Sequence[_ImageObject], time_s: float
) -> tuple[Int, Int, Float64]:
    """Return for each object its samples without occlusion, its visible samples, and its area in pixels."""
    if not image_objects:
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)
    pixels, owner = _sample_pixels(image_objects, _SAMPLES)
    rays = camera.rays(pixels)
    covers = np.concatenate(
        [
            _covers(world, rays, np.flatnonzero(owner == n), s.state)
            for n, s in enumerate(image_objects)
        ]
    )
    index = np.flatnonzero(covers)
    before = camera.rays(pixels[index])
    _, moving = world.moving_at(time_s, 150.0)
    hits = world.scene.cast(before, moving)
    instance = world.scene.tables.instances[hits.object_row]
    own = np.array([image_object.actor.track_id + 1 for image_object in image_objects])[
        owner[index]
    ]
    is_observed = (hits.row >= 0) & (instance == own)
    alone = np.bincount(owner[index], minlength=len(image_objects))
    seen = np.bincount(owner[index[is_observed]], minlength=len(image_objects))
    size = np.array([s.box_px[2:] - s.box_px[:2] for s in image_objects]).prod(axis=1)
    return alone, seen, size * alone / np.bincount(owner, minlength=len(image_objects))


def _sample_pixels(image_objects: Sequence[_ImageObject], max_samples: int) -> tuple[Float64, Int]:
    """Lay an even lattice of pixels over every box."""
    lattices, owners = [], []
    for number, image_object in enumerate(image_objects):
        x0, y0, x1, y1 = image_object.box_px
        columns = min(max_samples, max(2, int(x1 - x0)))
        rows = min(max_samples, max(2, int(y1 - y0)))
        x = x0 + (np.arange(columns) + 0.5) / columns * (x1 - x0)
        y = y0 + (np.arange(rows) + 0.5) / rows * (y1 - y0)
        lattices.append(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
        owners.append(np.full(columns * rows, number))
    return np.concatenate(lattices), np.concatenate(owners)


def _covers(world: World, rays: Rays, index: Int, state: MovingObject) -> Bool:
    """Return which rays hit an object, other objects ignored."""
    origins, directions = to_local(rays, index, state)
    return world.scene.meets(state.shape, origins, directions)


def label_around(
    world: World, world_SE3_velo: Float64, time_s: float, *, by_category: bool = False
) -> Labels:
    """Label all objects within 80 m of the ego vehicle, in the camera's view or not; image boxes are -1.

    Args:
        world: World of the drive.
        world_SE3_velo: (4, 4) pose of the LiDAR.
        time_s: Time of the scan.
        by_category: Whether buses, trailers, motorcycles and bicycles without riders, which KITTI does not
            have, are classes of their own.
    """
    actors = [actor for actor in world.actors if world.is_near(actor, time_s, 80.0)]
    poses = [world.state(actor, time_s).world_SE3_object for actor in actors]
    sizes_m = [actor.body.size_m for actor in actors]
    types = [actor.body.category if by_category else actor.body.kind for actor in actors]
    track_ids = [actor.track_id for actor in actors]
    for number, box in enumerate(world.static_boxes if by_category else ()):
        if world.is_place_near(box.world_SE3_box, time_s, 80.0):
            poses.append(box.world_SE3_box)
            sizes_m.append(box.size_m)
            types.append(box.category)
            track_ids.append(len(world.actors) + number)
    boxes = _boxes_velo(poses, sizes_m, world_SE3_velo)
    return labels_of_boxes(boxes, types, np.array(track_ids, np.int64))


def _boxes_velo(
    world_SE3_objects: Sequence[Float64],
    sizes_m: Sequence[tuple[float, float, float]],
    world_SE3_velo: Float64,
) -> Boxes3D:
    """Return upright boxes in the LiDAR's frame."""
    if not world_SE3_objects:
        return Boxes3D.empty()
    poses = se3.inverse(world_SE3_velo) @ np.stack(world_SE3_objects)
    yaw_rad = np.arctan2(poses[:, 1, 0], poses[:, 0, 0])
    return Boxes3D(poses[:, :3, 3], np.array(sizes_m, float), yaw_rad)
