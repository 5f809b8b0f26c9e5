"""Objects in OpenCV's XML, one after another.

Nothing outside the file is read and nothing in it is expanded: a document type, which alone can declare entities, is
refused.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from data.kitti.reading import read_bytes
from perception.errors import LabelError
from perception.types import Float64

_ROOT, _MAX_DEPTH = "opencv_storage", 16
_MAX_WHOLE, _MAX_NUMBER = 2**31, 1e9
_WHAT = "XML of OpenCV"


@dataclass(frozen=True)
class StoredObject:
    """One object of a file.

    Attributes:
        where: File and line, for error messages.
        texts: Text of each element by its path within the object.
    """

    where: str
    texts: dict[str, str]

    def text(self, name: str) -> str:
        """Return the text of an element.

        Raises:
            LabelError: There is no such element.
        """
        if name not in self.texts:
            raise LabelError(self.where, expected=f"an object with {name}", found="none")
        return self.texts[name].strip()

    def whole(self, name: str) -> int:
        """Return the whole number of an element; raise as `text`, also where it is none."""
        text = self.text(name)
        try:
            number = int(text)
        except ValueError:
            number = _MAX_WHOLE
        if abs(number) >= _MAX_WHOLE:
            raise LabelError(self.where, expected=f"a whole number as {name}", found=repr(text))
        return number

    def rows(self, name: str, columns: int) -> Float64:
        """Return the (R, columns) numbers of a matrix; raise as `text`, also where it is no such matrix."""
        words = self.text(f"{name}/data").split()
        expected = f"rows of {columns} numbers as {name}"
        if not words or len(words) % columns:
            raise LabelError(self.where, expected=expected, found=f"{len(words)} words")
        try:
            numbers = np.array(words, np.float64)
        except ValueError as error:
            raise LabelError(self.where, expected=expected, found=str(error)) from error
        if not (np.abs(numbers) < _MAX_NUMBER).all():  # false with NaN
            found = f"{np.abs(numbers).max():g}"
            raise LabelError(self.where, expected=f"numbers in metres as {name}", found=found)
        return numbers.reshape(-1, columns)


def read_storage(
    path: Path, names: Collection[str], take: Callable[[StoredObject], object]
) -> None:
    """Hand over the objects of a file in turn.

    Args:
        path: XML file.
        names: Paths of the elements whose text is read, such as transform/data.
        take: Function of an object.

    Raises:
        LabelError: The file cannot be read, or is not XML of OpenCV.
    """
    parser = expat.ParserCreate("UTF-8")  # whatever the file states
    parser.buffer_text = True
    reader = _StorageReader(path, parser, names, take)
    parser.StartElementHandler, parser.EndElementHandler = reader.start, reader.end
    parser.CharacterDataHandler = reader.add_text
    parser.StartDoctypeDeclHandler = reader.refuse_document_type
    try:
        parser.Parse(read_bytes(path, LabelError, _WHAT), True)
    except expat.ExpatError as error:
        found = f"an error: {expat.ErrorString(error.code)}"
        raise LabelError(f"{path} line {error.lineno}", expected=_WHAT, found=found) from error


def parse_elements(path: Path, text: str) -> ElementTree.Element:
    """Return the root of a document of XML without document type.

    Args:
        path: File of the document, for error messages.
        text: The document.

    Raises:
        LabelError: It is no XML, or has a document type, in which entities can be declared.
    """
    parser, builder = expat.ParserCreate("UTF-8"), ElementTree.TreeBuilder()

    def refuse(*_: Any) -> None:  # noqa: ANN401 - arguments of expat
        raise LabelError(path, expected="XML without declarations", found="a DOCTYPE")

    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(text.encode(), True)
        return builder.close()
    except expat.ExpatError as error:
        found = f"an error: {expat.ErrorString(error.code)}"
        raise LabelError(f"{path} line {error.lineno}", expected="XML", found=found) from error


class _StorageReader:
    """Handlers of the parser."""

    def __init__(
        self,
        path: Path,
        parser: expat.XMLParserType,
        names: Collection[str],
        take: Callable[[StoredObject], object],
    ) -> None:
        self._path, self._parser, self._names, self._take = path, parser, names, take
        self._elements: list[str] = []
        self._object, self._pieces = StoredObject("", {}), list[str]()

    @property
    def _where(self) -> str:
        return f"{self._path} line {self._parser.CurrentLineNumber}"

    @property
    def _name(self) -> str:
        return "/".join(self._elements[2:])

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """Begin an element."""
        if not self._elements and name != _ROOT:
            raise LabelError(self._where, expected=f"{_WHAT}, <{_ROOT}>", found=f"<{name[:40]}>")
        if len(self._elements) == _MAX_DEPTH:
            found = f"elements more than {_MAX_DEPTH} deep"
            raise LabelError(self._where, expected=_WHAT, found=found)
        self._elements.append(name)
        if len(self._elements) == 2:
            self._object = StoredObject(self._where, {})
        self._pieces.clear()

    def add_text(self, text: str) -> None:
        """Add text to the innermost element."""
        self._pieces.append(text)

    def end(self, name: str) -> None:
        """End an element."""
        if self._name in self._names:
            self._object.texts[self._name] = "".join(self._pieces)
        self._pieces.clear()
        if len(self._elements) == 2:
            self._take(self._object)
        self._elements.pop()

    def refuse_document_type(self, *_: Any) -> None:  # noqa: ANN401 - arguments of expat
        """Refuse what entities are declared in."""
        raise LabelError(self._where, expected=f"{_WHAT} without a DOCTYPE", found="one")
