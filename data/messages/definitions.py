"""Types of the messages: those of ROS 2, and of the packages `foxglove_msgs` and `vision_msgs` as far as they are written.

Messages are binary (CDR) as ROS 2 writes them, so that its tools, Foxglove and other viewers read one form.
"""

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from perception.errors import optional_package

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

# Fields of the public message lists of both packages, in their order, which the binary form depends on.
_DEFINITIONS: Mapping[str, str] = {
    "foxglove_msgs/msg/Color": "float64 r\nfloat64 g\nfloat64 b\nfloat64 a",
    "foxglove_msgs/msg/KeyValuePair": "string key\nstring value",
    "foxglove_msgs/msg/Point2": "float64 x\nfloat64 y",
    "foxglove_msgs/msg/CircleAnnotation": """builtin_interfaces/Time timestamp
        foxglove_msgs/Point2 position
        float64 diameter
        float64 thickness
        foxglove_msgs/Color fill_color
        foxglove_msgs/Color outline_color""",
    "foxglove_msgs/msg/PointsAnnotation": """uint8 UNKNOWN=0
        uint8 POINTS=1
        uint8 LINE_LOOP=2
        uint8 LINE_STRIP=3
        uint8 LINE_LIST=4
        builtin_interfaces/Time timestamp
        uint8 type
        foxglove_msgs/Point2[] points
        foxglove_msgs/Color outline_color
        foxglove_msgs/Color[] outline_colors
        foxglove_msgs/Color fill_color
        float64 thickness""",
    "foxglove_msgs/msg/TextAnnotation": """builtin_interfaces/Time timestamp
        foxglove_msgs/Point2 position
        string text
        float64 font_size
        foxglove_msgs/Color text_color
        foxglove_msgs/Color background_color""",
    "foxglove_msgs/msg/ImageAnnotations": """foxglove_msgs/CircleAnnotation[] circles
        foxglove_msgs/PointsAnnotation[] points
        foxglove_msgs/TextAnnotation[] texts""",
    "foxglove_msgs/msg/ArrowPrimitive": """geometry_msgs/Pose pose
        float64 shaft_length
        float64 shaft_diameter
        float64 head_length
        float64 head_diameter
        foxglove_msgs/Color color""",
    "foxglove_msgs/msg/CubePrimitive": """geometry_msgs/Pose pose
        geometry_msgs/Vector3 size
        foxglove_msgs/Color color""",
    "foxglove_msgs/msg/SpherePrimitive": """geometry_msgs/Pose pose
        geometry_msgs/Vector3 size
        foxglove_msgs/Color color""",
    "foxglove_msgs/msg/CylinderPrimitive": """geometry_msgs/Pose pose
        geometry_msgs/Vector3 size
        float64 bottom_scale
        float64 top_scale
        foxglove_msgs/Color color""",
    "foxglove_msgs/msg/LinePrimitive": """uint8 LINE_STRIP=0
        uint8 LINE_LOOP=1
        uint8 LINE_LIST=2
        uint8 type
        geometry_msgs/Pose pose
        float64 thickness
        bool scale_invariant
        geometry_msgs/Point[] points
        foxglove_msgs/Color color
        foxglove_msgs/Color[] colors
        uint32[] indices""",
    "foxglove_msgs/msg/TriangleListPrimitive": """geometry_msgs/Pose pose
        geometry_msgs/Point[] points
        foxglove_msgs/Color color
        foxglove_msgs/Color[] colors
        uint32[] indices""",
    "foxglove_msgs/msg/TextPrimitive": """geometry_msgs/Pose pose
        bool billboard
        float64 font_size
        bool scale_invariant
        foxglove_msgs/Color color
        string text""",
    "foxglove_msgs/msg/ModelPrimitive": """geometry_msgs/Pose pose
        geometry_msgs/Vector3 scale
        foxglove_msgs/Color color
        bool override_color
        string url
        string media_type
        uint8[] data""",
    "foxglove_msgs/msg/SceneEntity": """builtin_interfaces/Time timestamp
        string frame_id
        string id
        builtin_interfaces/Duration lifetime
        bool frame_locked
        foxglove_msgs/KeyValuePair[] metadata
        foxglove_msgs/ArrowPrimitive[] arrows
        foxglove_msgs/CubePrimitive[] cubes
        foxglove_msgs/SpherePrimitive[] spheres
        foxglove_msgs/CylinderPrimitive[] cylinders
        foxglove_msgs/LinePrimitive[] lines
        foxglove_msgs/TriangleListPrimitive[] triangles
        foxglove_msgs/TextPrimitive[] texts
        foxglove_msgs/ModelPrimitive[] models""",
    "foxglove_msgs/msg/SceneEntityDeletion": """uint8 MATCHING_ID=0
        uint8 ALL=1
        builtin_interfaces/Time timestamp
        uint8 type
        string id""",
    "foxglove_msgs/msg/SceneUpdate": """foxglove_msgs/SceneEntityDeletion[] deletions
        foxglove_msgs/SceneEntity[] entities""",
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score",
    "vision_msgs/msg/ObjectHypothesisWithPose": """vision_msgs/ObjectHypothesis hypothesis
        geometry_msgs/PoseWithCovariance pose""",
    "vision_msgs/msg/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size",
    "vision_msgs/msg/Detection3D": """std_msgs/Header header
        vision_msgs/ObjectHypothesisWithPose[] results
        vision_msgs/BoundingBox3D bbox
        string id""",
    "vision_msgs/msg/Detection3DArray": """std_msgs/Header header
        vision_msgs/Detection3D[] detections""",
}


@cache
def typestore() -> "Typestore":
    """Return all message types.

    Raises:
        MissingDependencyError: rosbags is not installed.
    """
    with optional_package("rosbags", needed_for="messages of ROS 2", extra="live"):
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in _DEFINITIONS.items():
        lines = "\n".join(line.strip() for line in text.splitlines())
        store.register(get_types_from_msg(lines, name))
    return store


def message(kind: str, **fields: Any) -> Any:  # noqa: ANN401 - classes that rosbags makes of the definitions
    """Return a message.

    Args:
        kind: Package and name, such as `sensor_msgs/PointCloud2`.
        fields: Values of fields; others are 0, false or empty.
    """
    made, empty = _class_and_fields(kind)
    return made(**{**empty, **fields})


@cache
def _class_and_fields(kind: str) -> tuple[Any, dict[str, Any]]:
    full = kind.replace("/", "/msg/")
    return typestore().types[full], _empty_fields(full)


@cache
def _empty_fields(kind: str) -> dict[str, Any]:
    """Return all fields of a message by its full name, each of them empty."""
    _, definitions = typestore().fielddefs[kind]
    return {name: _empty(one) for name, one in definitions}


def _empty(definition: Any) -> Any:  # noqa: ANN401 - a field of a message, and its value
    """Return 0, false or nothing for the definition of a field."""
    from rosbags.interfaces import Nodetype

    node, detail = definition
    if node == Nodetype.NAME:
        return message(detail.replace("/msg/", "/"))
    if node == Nodetype.BASE:
        return {"string": "", "bool": False}.get(detail[0], 0)
    (inner, kind), count = detail
    if inner == Nodetype.NAME or kind[0] == "string":
        return []
    return np.zeros(count if node == Nodetype.ARRAY else 0, kind[0])


def encoded(value: Any) -> bytes:  # noqa: ANN401 - see `message`
    """Return the binary form of a message."""
    return bytes(typestore().serialize_cdr(value, value.__msgtype__))


def definition_of(kind: str) -> str:
    """Return the definition of a message type with those of all types in it, as files and servers state it.

    Args:
        kind: Full name, such as `sensor_msgs/msg/PointCloud2`.
    """
    return typestore().generate_msgdef(kind, ros_version=2)[0]
