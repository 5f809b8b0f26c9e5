"""The state of running objects as a file of numbers and text: taken while they run, restored into others of their kind.

    document  JSON: values by their number, each once, however many refer to it
    bytes_N   memory of arrays; an array is a type, a shape, an offset and strides in one of them

Arrays keep their layout and what they share, so that what is computed from them stays the same to the last bit. Reading
a file runs nothing of it: objects are of classes of `perception` and `data`, made without a call, and filled.
"""

import importlib
import io
import json
from array import array
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from enum import Enum
from pathlib import Path
from typing import Any, ClassVar, cast
from zipfile import ZIP_STORED, BadZipFile, ZipFile, ZipInfo

import numpy as np
from numpy.typing import NDArray

from perception.errors import DriveError

# Packages whose classes a snapshot may hold.
_OURS = ("perception", "data")
_DOCUMENT = "document.json"
# Values that JSON has; NaN and infinity are read back, too.
_PLAIN = (type(None), bool, int, float, str)
# Where a fixed date stands, equal states are equal files.
_EPOCH = (1980, 1, 1, 0, 0, 0)

Value = Any  # whatever stages remember
Node = dict[str, Any]


class NotStorableError(TypeError):
    """A value of a kind that has no place in a file, such as an open file or a tracker of OpenCV."""


def write_snapshot(value: Value) -> bytes:
    """Return a value and all that it refers to as the content of a file.

    Args:
        value: Numbers, text, arrays, lists, tuples, dicts, sets, random generators, and objects of our classes of such.

    Raises:
        NotStorableError: Something in it is of another kind.
    """
    writer = _Writer()
    root = writer.reference(value)
    document = json.dumps({"root": root, "nodes": writer.nodes})
    file = io.BytesIO()
    with ZipFile(file, "w", ZIP_STORED) as archive:
        _add(archive, _DOCUMENT, document.encode())
        for number, memory in enumerate(writer.memories):
            _add(archive, f"bytes_{number}", memory)
    return file.getvalue()


def read_snapshot(data: bytes, where: Path | str) -> Value:
    """Return the value of a snapshot.

    Args:
        data: Content of the file; no more memory is taken than it has.
        where: Name of the file for the error.

    Raises:
        DriveError: It is damaged, or no snapshot.
    """
    try:
        with ZipFile(io.BytesIO(data)) as archive:
            if any(one.compress_type != ZIP_STORED for one in archive.infolist()):
                raise ValueError("compressed entries")
            document = json.loads(archive.read(_DOCUMENT))
            nodes = document["nodes"]
            return _Reader(nodes, lambda n: archive.read(f"bytes_{n:d}")).value(document["root"])
    except (BadZipFile, ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        raise _damaged(where, str(error)) from error
    except (ImportError, RecursionError, EOFError, NotImplementedError, RuntimeError) as error:
        raise _damaged(where, str(error)) from error


def _damaged(where: Path | str, reason: str) -> DriveError:
    return DriveError(
        where,
        expected="a snapshot of this version",
        found=f"a damaged file ({reason})" if reason else "a damaged file",
        advice="start again with --overwrite",
    )


def _add(archive: ZipFile, name: str, data: bytes) -> None:
    archive.writestr(ZipInfo(name, _EPOCH), data)


class Restorable:
    """An object whose attributes hold what it remembers of earlier frames.

    Attributes:
        memories: Names of these attributes.
    """

    memories: ClassVar[tuple[str, ...]]

    def snapshot(self) -> bytes:
        """Return what is remembered of earlier frames.

        Raises:
            NotStorableError: Something of it has no place in a file.
        """
        return write_snapshot({name: getattr(self, name) for name in self.memories})

    def restore(self, snapshot: bytes) -> None:
        """Go on from what an object of the same configuration remembered.

        Raises:
            DriveError: It is damaged, or of another configuration.
        """
        where = type(self).__name__
        values = read_snapshot(snapshot, where)
        if not isinstance(values, dict) or tuple(values) != self.memories:
            raise _damaged(where, "it is of another version")
        for name, value in values.items():
            kinds = {type(value), type(getattr(self, name)), type(None)}
            if len(kinds) > 2:  # one kind, or nothing at one of both times
                raise _damaged(where, f"{name} is of another kind")
            setattr(self, name, value)


class _Writer:
    """Numbers every value that is not plain, and describes it by the numbers of those that it refers to."""

    def __init__(self) -> None:
        self.nodes: list[Node | None] = []
        self.memories: list[bytes] = []
        self._numbers: dict[int, int] = {}
        self._memory_numbers: dict[int, int] = {}
        self._alive: list[Value] = []  # an id is of one object as long as it lives

    def reference(self, value: Value) -> Value:
        """Return a plain value as it is, and another as the list of its number."""
        if type(value) in _PLAIN:
            return value
        number = self._numbers.get(id(value))
        if number is None:
            number = self._numbers[id(value)] = len(self.nodes)
            self._alive.append(value)
            self.nodes.append(None)
            self.nodes[number] = self._node(value)
        return [number]

    def _node(self, value: Value) -> Node:
        kind = type(value)
        if isinstance(value, Enum):
            return {"enum": _name_of(kind), "name": value.name}
        if kind in _ITEMS:
            return {kind.__name__: [self.reference(item) for item in value]}
        if (node := _NODES.get(kind)) is not None:
            return node(self, value)
        if isinstance(value, np.generic):
            return {"scalar": self.reference(np.asarray(value))}
        if isinstance(value, Path):
            return {"path": str(value)}
        fields = {name: self.reference(item) for name, item in _fields(value)}
        return {"class": _name_of(kind), "fields": fields}

    def array(self, value: NDArray[Any]) -> Node:
        """Describe an array by its place in the memory of the array that owns it."""
        if value.dtype.hasobject:
            raise NotStorableError("an array of objects")
        owner: NDArray[Any] = value
        while isinstance(owner.base, np.ndarray):
            owner = owner.base
        memory = _memory_of(owner)
        if memory is None:  # a part of what is not ours, with gaps
            owner = value = value.copy(order="K")
            memory = _memory_of(owner)
            assert memory is not None
        number = self._memory_numbers.get(id(owner))
        if number is None:
            number = self._memory_numbers[id(owner)] = self.memory(memory.tobytes())
            self._alive.append(owner)
        offset = value.__array_interface__["data"][0] - owner.__array_interface__["data"][0]
        return {
            "array": number,
            "dtype": np.lib.format.dtype_to_descr(value.dtype),
            "shape": value.shape,
            "offset": offset if value.size else 0,
            "strides": value.strides,
            "is_writeable": value.flags.writeable,
        }

    def memory(self, data: bytes) -> int:
        """Keep bytes; return their number."""
        self.memories.append(data)
        return len(self.memories) - 1


_ITEMS = (list, tuple, set, frozenset)
_NODES: Mapping[type, Callable[[_Writer, Value], Node]] = {
    np.ndarray: lambda to, value: to.array(value),
    bytes: lambda to, value: {"bytes": to.memory(value)},
    bytearray: lambda to, value: {"bytearray": to.memory(bytes(value))},
    array: lambda to, value: {"numbers": value.typecode, "bytes": to.memory(value.tobytes())},
    deque: lambda to, value: {
        "deque": [to.reference(item) for item in value],
        "maxlen": value.maxlen,
    },
    dict: lambda to, value: {"dict": [[*map(to.reference, pair)] for pair in value.items()]},
    np.random.Generator: lambda to, value: {"random": to.reference(value.bit_generator.state)},
}


class _Reader:
    """Makes the values of a snapshot, each once."""

    def __init__(self, nodes: list[Node], memory: Callable[[int], bytes]) -> None:
        self._nodes, self._read = nodes, memory
        self._made: dict[int, Value] = {}
        self._memories: dict[int, NDArray[np.uint8]] = {}

    def value(self, reference: Value) -> Value:
        """Return the value of a reference."""
        if not isinstance(reference, list):
            return reference
        (number,) = reference
        if number not in self._made:
            self._made[number] = self._make(number, self._nodes[number])
        return self._made[number]

    def _make(self, number: int, node: Node) -> Value:
        kind, content = next(iter(node.items()))
        if kind == "class":
            return self._object(number, node)
        if kind in ("list", "dict"):
            return self._container(number, kind, content)
        makers: Mapping[str, Callable[[], Value]] = {
            "array": lambda: self._array(node),
            "scalar": lambda: self.value(content)[()],
            "enum": lambda: _class(content, Enum)[node["name"]],
            "bytes": lambda: self._read(content),
            "bytearray": lambda: bytearray(self._read(content)),
            "numbers": lambda: array(content, self._read(node["bytes"])),
            "tuple": lambda: tuple(map(self.value, content)),
            "set": lambda: set(map(self.value, content)),
            "frozenset": lambda: frozenset(map(self.value, content)),
            "deque": lambda: deque(map(self.value, content), node["maxlen"]),
            "path": lambda: Path(content),
            "random": lambda: _generator(self.value(content)),
        }
        return makers[kind]()

    def _container(self, number: int, kind: str, content: Value) -> Value:
        """Make a list or a dict, which what it holds may refer to."""
        if kind == "list":
            items: list[Value] = []
            self._made[number] = items
            items += map(self.value, content)
            return items
        pairs: dict[Value, Value] = {}
        self._made[number] = pairs
        pairs.update((self.value(key), self.value(value)) for key, value in content)
        return pairs

    def _object(self, number: int, node: Node) -> Value:
        kind = _class(node["class"], object)
        made = self._made[number] = object.__new__(kind)
        for name, item in node["fields"].items():
            # Frozen dataclasses are filled, too.
            object.__setattr__(made, name, self.value(item))
        return made

    def _array(self, node: Node) -> NDArray[Any]:
        number = node["array"]
        if number not in self._memories:
            # An array, so that what shares it now shares it in the next snapshot, too.
            self._memories[number] = np.frombuffer(bytearray(self._read(number)), np.uint8)
        to_dtype = cast("Callable[[Value], np.dtype[Any]]", np.lib.format.descr_to_dtype)
        dtype = to_dtype(_as_descr(node["dtype"]))
        if dtype.hasobject:
            raise ValueError("an array of objects")
        made: NDArray[Any] = np.ndarray(
            tuple(node["shape"]),
            dtype,
            self._memories[number],
            node["offset"],
            tuple(node["strides"]),
        )
        made.flags.writeable = node["is_writeable"]
        return made


def _memory_of(owner: NDArray[Any]) -> NDArray[Any] | None:
    """Return the memory of an array in the order of its addresses, or None where there are gaps in it."""
    axes = sorted(range(owner.ndim), key=lambda axis: -owner.strides[axis])
    ordered = owner.transpose(axes)
    return ordered if ordered.flags.c_contiguous else None


def _fields(value: Value) -> Iterator[tuple[str, Value]]:
    """Yield the attributes of an object."""
    yield from getattr(value, "__dict__", {}).items()
    for kind in type(value).__mro__:
        for name in getattr(kind, "__slots__", ()):
            with suppress(AttributeError):
                yield name, getattr(value, name)


def _is_ours(kind: type) -> bool:
    """Return whether objects of a class are stored: plain ones of our packages."""
    if issubclass(kind, tuple | dict | list | BaseException):
        return False
    return kind.__module__.partition(".")[0] in _OURS and "<locals>" not in kind.__qualname__


def _name_of(kind: type) -> str:
    if not _is_ours(kind):
        raise NotStorableError(f"{kind.__module__}.{kind.__qualname__}")
    return f"{kind.__module__}:{kind.__qualname__}"


def _class(name: str, base: type) -> Any:  # noqa: ANN401 - a class, whose kind the caller knows
    """Return a class of ours by its name."""
    module, _, path = name.partition(":")
    if module.partition(".")[0] not in _OURS or "__" in module:  # __main__ is a program
        raise ValueError(f"a class of {module}")
    found: Any = importlib.import_module(module)
    for part in path.split("."):
        found = getattr(found, part)
    if not isinstance(found, type) or not issubclass(found, base) or not _is_ours(found):
        raise TypeError(f"no class {name}")
    return found


def _generator(state: Value) -> np.random.Generator:
    if not isinstance(state, dict) or state.get("bit_generator") != "PCG64":
        raise ValueError("another random generator")
    generator = np.random.PCG64()
    generator.state = cast("Any", state)
    return np.random.Generator(generator)


def _as_descr(descr: Value) -> Value:
    """Return the description of a type as NumPy has it: its fields are tuples, which JSON has not."""
    if isinstance(descr, str):
        return descr
    return [(name, _as_descr(kind), *(tuple(one) for one in shape)) for name, kind, *shape in descr]
