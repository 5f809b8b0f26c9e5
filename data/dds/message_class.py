"""Types of DDS made of the definitions of messages; values pass through them in their binary form (CDR)."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import new_class
from typing import Any

from data.messages.definitions import typestore

_PRIMITIVES = (
    *("int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"),
    *("float32", "float64"),
)


@cache
def message_class(kind: str) -> type[Any]:
    """Return the class of a message, whose values hold its binary form in `binary`.

    The name and the fields are what others compare with theirs; encoding is left to the type store of messages.

    Args:
        kind: Full name, such as `sensor_msgs/msg/PointCloud2`.
    """
    from cyclonedds.idl import IdlStruct
    from cyclonedds.idl.annotations import final

    _, definitions = typestore().fielddefs[kind]
    members = {
        "__annotations__": {name: _type_of(definition) for name, definition in definitions},
        "serialize": lambda self, *_, **__: self.binary,
        "deserialize": classmethod(lambda made, data, *_, **__: _holding(made, data)),
    }
    made = new_class(
        f"{kind.rpartition('/')[2]}_",
        (IdlStruct,),
        {"typename": type_name(kind).replace("::", ".")},
        lambda namespace: namespace.update(members),
    )
    shaped: type[Any] = final(dataclass(made))
    return shaped


def value_of(kind: str, binary: bytes) -> Any:  # noqa: ANN401 - a class made of the definition
    """Return the value of a message in its binary form, as writers take it."""
    return _holding(message_class(kind), binary)


def type_name(kind: str) -> str:
    """Return the name that ROS 2 gives a type in DDS, such as sensor_msgs::msg::dds_::PointCloud2_."""
    package, _, name = kind.rpartition("/msg/")
    return f"{package}::msg::dds_::{name}_"


def kind_of(type_name: str) -> str:
    """Return the full name of a message by that of its type in DDS, or an empty text."""
    package, _, name = type_name.partition("::msg::dds_::")
    return f"{package}/msg/{name[:-1]}" if name.endswith("_") else ""


def _holding(made: type[Any], binary: bytes) -> Any:  # noqa: ANN401
    value = object.__new__(made)
    value.binary = binary
    return value


@cache
def _primitives() -> Mapping[str, Any]:
    from cyclonedds.idl import types

    numbers = {name: getattr(types, name) for name in _PRIMITIVES}
    return {"bool": bool, "string": str, "octet": types.byte, "byte": types.byte, **numbers}


def _type_of(definition: Any) -> Any:  # noqa: ANN401 - a field of a message, and its type
    from cyclonedds.idl.types import array, sequence
    from rosbags.interfaces import Nodetype

    node, detail = definition
    if node == Nodetype.NAME:
        return message_class(detail)
    if node == Nodetype.BASE:
        return _primitives()[detail[0]]
    inner, count = detail
    element = _type_of(inner)
    shape: Any = array if node == Nodetype.ARRAY else sequence
    return shape[element, count] if node == Nodetype.ARRAY else shape[element]
