"""Which topics of a bag are the parts of a drive: found by their types, or named."""

from collections.abc import Sequence
from dataclasses import dataclass

from data.bags.bag import Bag, BagTopic
from data.bags.transforms import TF_TOPICS
from perception.errors import DriveError, UsageError

_POINTS = "sensor_msgs/msg/PointCloud2"
_IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
_CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
_ODOMETRY = "nav_msgs/msg/Odometry"
_FIX, _IMU = "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/Imu"
_DEPTH = ("depth", "disparity")  # in the names of topics whose images are no colours


@dataclass(frozen=True)
class BagTopics:
    """Topics of a drive.

    Attributes:
        lidars: Scans, the first of which gives frame and time of the merged scan.
        camera: Images, or None.
        camera_info: Calibration of the camera, or None.
        odometry: Poses, or None.
        fixes: Positions on the globe, or None; used with `imu` where there is no odometry.
        imu: Orientations, or None.
        transforms: Transforms between frames.
        notes: Sentences on choices among several.
    """

    lidars: tuple[str, ...]
    camera: str | None
    camera_info: str | None
    odometry: str | None
    fixes: str | None
    imu: str | None
    transforms: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def timed(self) -> tuple[str, ...]:
        """Topics of which many messages are read by their time."""
        parts = (self.camera, self.odometry, self.fixes, self.imu)
        return (*self.lidars, *(topic for topic in parts if topic is not None))


def choose_topics(
    bag: Bag, lidar: str | None = None, camera: str | None = None, poses: str | None = None
) -> BagTopics:
    """Choose the topics of a drive.

    Args:
        bag: Bag of the topics.
        lidar: Topics of the scans, with commas; else the one with most bytes a message.
        camera: Topic of the images; else the first that has a calibration.
        poses: Topic of the odometry; else the one with most messages.

    Raises:
        DriveError: There are no scans.
        UsageError: A topic that was named is not in the bag, or of another type.
    """
    clouds = _of_kind(bag, _POINTS)
    if not clouds:
        raise DriveError(
            bag.path,
            expected=f"messages of type {_POINTS}",
            found=", ".join(f"{one.name} ({one.kind})" for one in bag.topics) or "no topics",
        )
    images = [one for kind in _IMAGES for one in _of_kind(bag, kind)]
    notes: list[str] = []
    lidars = _named(bag, "--lidar", lidar, clouds) or (_densest(bag, clouds),)
    if lidar is None and len(clouds) > 1:
        names = ", ".join(one.name for one in clouds)
        notes.append(f"{bag.path}: scans of {lidars[0]} among {names}; others with --lidar")
    named = _named(bag, "--camera", camera, images)
    chosen = named[0] if named else _best_camera(bag, images)
    if camera is None and len(images) > 1 and chosen is not None:
        names = ", ".join(one.name for one in images)
        notes.append(f"{bag.path}: images of {chosen} among {names}; another with --camera")
    odometry = _of_kind(bag, _ODOMETRY)
    stated = _named(bag, "--odometry", poses, odometry)
    if poses is None and len(odometry) > 1:
        names = ", ".join(one.name for one in odometry)
        notes.append(
            f"{bag.path}: poses of {_longest(odometry)} among {names}; others with --odometry"
        )
    return BagTopics(
        lidars=lidars,
        camera=chosen,
        camera_info=camera_info_of(bag, chosen) if chosen else None,
        odometry=stated[0] if stated else _longest(odometry),
        fixes=_longest(_of_kind(bag, _FIX)),
        imu=_longest(_of_kind(bag, _IMU)),
        transforms=tuple(name for name in bag.kinds if name.rsplit("/", 1)[-1] in _TF_NAMES),
        notes=tuple(notes),
    )


_TF_NAMES = {topic.lstrip("/") for topic in TF_TOPICS}


def camera_info_of(bag: Bag, image_topic: str) -> str | None:
    """Return the topic of the calibration that lies nearest to that of the images, or None."""
    parts = image_topic.split("/")
    names = {one.name for one in _of_kind(bag, _CAMERA_INFO)}
    for length in range(len(parts) - 1, 0, -1):
        name = "/".join([*parts[:length], "camera_info"])
        if name in names:
            return name
    return None


def _of_kind(bag: Bag, kind: str) -> list[BagTopic]:
    return [one for one in bag.topics if one.kind == kind and one.count]


def _named(bag: Bag, flag: str, names: str | None, known: Sequence[BagTopic]) -> tuple[str, ...]:
    """Return the topics that are named with commas, with or without the leading slash."""
    asked = [name.strip() for name in (names or "").split(",") if name.strip()]
    by_name = {one.name.strip("/"): one.name for one in known}
    for name in asked:
        if name.strip("/") not in by_name:
            raise UsageError(
                f"{flag} {name}",
                expected=f"topics of {bag.path}: {', '.join(by_name.values()) or 'none of this type'}",
                found="another one",
            )
    return tuple(dict.fromkeys(by_name[name.strip("/")] for name in asked))


def _densest(bag: Bag, clouds: Sequence[BagTopic]) -> str:
    """Return the topic whose first message is largest: parts of a scan, such as obstacles, are smaller."""
    if len(clouds) == 1:
        return clouds[0].name
    return max(clouds, key=lambda one: len(next(bag.messages((one.name,))).data)).name


def _best_camera(bag: Bag, images: Sequence[BagTopic]) -> str | None:
    """Return the first camera with a calibration, else the first, depth images left out."""
    names = [one.name for one in images if not any(word in one.name.lower() for word in _DEPTH)]
    calibrated = [name for name in names if camera_info_of(bag, name)]
    return next(iter(calibrated or names), None)


def _longest(topics: Sequence[BagTopic]) -> str | None:
    return max(topics, key=lambda one: one.count).name if topics else None
