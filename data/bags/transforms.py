"""Transforms between the frames of a robot, from the messages of tf."""

from collections import deque
from collections.abc import Collection
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from perception.errors import CalibrationError
from perception.geometry.se3 import from_rotation_translation, inverse
from perception.types import Float64

TF_TOPICS = ("/tf_static", "/tf")


class TransformTree:
    """Fixed transforms between frames: the first one that is stated from each frame to its parent."""

    def __init__(self, source: str) -> None:
        """Set the name of the source, for error messages."""
        self._source = source
        self._parent_SE3_child: dict[tuple[str, str], Float64] = {}

    def add(self, message: Any) -> None:  # noqa: ANN401 - see Bag.decode
        """Add the transforms of a tf2_msgs/TFMessage."""
        for one in message.transforms:
            edge = frame_name(one.header.frame_id), frame_name(one.child_frame_id)
            if edge not in self._parent_SE3_child:
                pose = _rigid(one.transform.rotation, one.transform.translation)
                if pose is not None:
                    self._parent_SE3_child[edge] = pose

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of all frames."""
        return tuple(sorted({frame for edge in self._parent_SE3_child for frame in edge}))

    def has_parent(self, frame: str) -> bool:
        """Return whether a transform states where a frame is."""
        return any(child == frame_name(frame) for _, child in self._parent_SE3_child)

    def root_of(self, frame: str, besides: Collection[str] = ()) -> str:
        """Return the frame that a frame is fixed to in the end.

        Args:
            frame: Frame.
            besides: Frames that are not among those that move with it.
        """
        parents = {child: parent for parent, child in self._parent_SE3_child}
        frame = frame_name(frame)
        for _ in parents:
            parent = parents.get(frame, frame)
            if parent in besides:
                break
            frame = parent
        return frame

    def find(self, dst: str, src: str) -> Float64 | None:
        """Return the (4, 4) transform dst_SE3_src along the tree, or None where the frames are not connected."""
        dst, src = frame_name(dst), frame_name(src)
        found: dict[str, Float64] = {dst: np.eye(4)}
        queue = deque([dst])
        while queue and src not in found:
            frame = queue.popleft()
            for (parent, child), parent_SE3_child in self._parent_SE3_child.items():
                if parent == frame and child not in found:
                    found[child] = found[frame] @ parent_SE3_child
                    queue.append(child)
                elif child == frame and parent not in found:
                    found[parent] = found[frame] @ inverse(parent_SE3_child)
                    queue.append(parent)
        return found.get(src)

    def require(self, dst: str, src: str, purpose: str) -> Float64:
        """Return the (4, 4) transform dst_SE3_src.

        Raises:
            CalibrationError: The frames are not connected.
        """
        pose = self.find(dst, src)
        if pose is None:
            raise CalibrationError(
                self._source,
                expected=f"a transform from {src} to {dst} in {' or '.join(TF_TOPICS)}, {purpose}",
                found=f"none between these among the frames {', '.join(self.frames) or 'of no tf message'}",
                advice="record /tf_static, too",
            )
        return pose


def frame_name(name: str) -> str:
    """Return the name of a frame without the leading slash of ROS 1."""
    return name.lstrip("/")


def pose_of(pose: Any) -> Float64 | None:  # noqa: ANN401
    """Return the (4, 4) pose of a geometry_msgs/Pose, or None where it is not one."""
    return _rigid(pose.orientation, pose.position)


def rotation_of(quaternion: Any) -> Float64 | None:  # noqa: ANN401
    """Return the (3, 3) rotation of a geometry_msgs/Quaternion, or None where it is 0 or not finite."""
    numbers = np.array([quaternion.x, quaternion.y, quaternion.z, quaternion.w], np.float64)
    length = np.linalg.norm(numbers)
    if not np.isfinite(length) or abs(length - 1) > 0.1:
        return None
    return np.asarray(Rotation.from_quat(numbers).as_matrix())


def _rigid(quaternion: Any, place: Any) -> Float64 | None:  # noqa: ANN401
    rotation = rotation_of(quaternion)
    position_m = np.array([place.x, place.y, place.z], np.float64)
    if rotation is None or not np.isfinite(position_m).all():
        return None
    return from_rotation_translation(rotation, position_m)
