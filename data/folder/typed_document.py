"""YAML into typed dataclasses: each field by its annotation, each fault one sentence."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from data.kitti.reading import read_text
from perception.errors import DriveError, PerceptionError

Config = TypeVar("Config")
_WORDS = {
    float: "a number", int: "a whole number", str: "a text", bool: "true or false", list: "a list",
    dict: "names and values", NoneType: "nothing",
}  # fmt: skip


def read_document(kind: type[Config], path: Path) -> Config:
    """Read a YAML file as a dataclass.

    Args:
        kind: Dataclass with a default for each field that may be left out.
        path: File of names and values.

    Raises:
        DriveError: The file cannot be read, is no YAML, or has a name or a value that the dataclass does not have.
    """
    import yaml

    from perception.yaml_text import read_yaml

    text = read_text(path, DriveError, "a YAML file of names and values")
    try:
        document = read_yaml(text)
    except yaml.YAMLError as error:
        found = " ".join(str(error).split())
        raise DriveError(path, expected="a YAML file of names and values", found=found) from error
    return _instance(kind, {} if document is None else document, str(path))


def _instance(kind: type[Config], document: object, where: str) -> Config:
    if not isinstance(document, Mapping):
        raise _unfitting(where, "names and values", document)
    hints = get_type_hints(kind)
    known = [one.name for one in _fields(kind)]
    if unknown := [name for name in document if name not in known]:
        raise DriveError(
            f"{where}: {unknown[0]}", expected=f"one of {', '.join(known)}", found="another name"
        )
    values = {name: _value(hints[name], one, f"{where}: {name}") for name, one in document.items()}
    missing = [one.name for one in _fields(kind) if _is_required(one) and one.name not in values]
    if missing:
        raise DriveError(where, expected=", ".join(missing), found="no such name")
    try:
        return kind(**values)
    except PerceptionError as error:
        place = f"{where}: {error.where}"
        raise DriveError(
            place, expected=error.expected, found=error.found, advice=error.advice
        ) from error


def _fields(kind: Any) -> tuple[dataclasses.Field[Any], ...]:  # noqa: ANN401 - any dataclass
    return dataclasses.fields(kind)


def _is_required(one: dataclasses.Field[Any]) -> bool:
    return one.default is dataclasses.MISSING and one.default_factory is dataclasses.MISSING


def _value(hint: Any, value: object, where: str) -> Any:  # noqa: ANN401 - of any annotation
    origin = get_origin(hint)
    if origin in (Union, UnionType):
        inner = next(one for one in get_args(hint) if one is not NoneType)
        return None if value is None else _value(inner, value, where)
    if origin is Literal:
        if value not in get_args(hint):
            raise _unfitting(where, f"one of {', '.join(get_args(hint))}", value)
        return value
    if origin is tuple:
        if not isinstance(value, list):
            raise _unfitting(where, "a list", value)
        kind = get_args(hint)[0]
        return tuple(_value(kind, one, f"{where} {place + 1}") for place, one in enumerate(value))
    if origin is dict:
        if not isinstance(value, Mapping):
            raise _unfitting(where, "names and values", value)
        kind = get_args(hint)[1]
        return {str(name): _value(kind, one, f"{where}: {name}") for name, one in value.items()}
    if dataclasses.is_dataclass(hint):
        return _instance(hint, value, where)  # type: ignore[arg-type]
    return _scalar(hint, value, where)


def _scalar(hint: Any, value: object, where: str) -> object:  # noqa: ANN401 - of any annotation
    if hint is float and isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    if hint is float and isinstance(value, str):  # YAML reads 1e-3 as a text
        try:
            return float(value)
        except ValueError:
            pass
    if hint is str and isinstance(value, (int, float)) and not isinstance(value, bool):
        return str(value)
    if type(value) is not hint:
        raise _unfitting(where, _WORDS[hint], value)
    return value


def _unfitting(where: str, expected: str, value: object) -> DriveError:
    found = _WORDS.get(type(value), type(value).__name__)
    # One line, whatever the file holds.
    shown = " ".join(f"{value}"[:80].split()) if isinstance(value, (str, int, float)) else found
    return DriveError(where, expected=expected, found=shown or "nothing")
