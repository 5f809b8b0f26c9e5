"""The decorator of compiled functions, and the types of their arguments.

numba takes half a second to import and to load what it has compiled: functions are compiled or loaded before their first
call, all at once by `load_compiled`, so that neither an import nor a frame waits for it.
"""

import hashlib
import logging
import threading
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache, update_wrapper
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

log = logging.getLogger(__name__)

Function = TypeVar("Function", bound=Callable[..., Any])
Scalar = type[np.generic]


@dataclass(frozen=True)
class ArrayType:
    """Type of an array.

    Attributes:
        scalar: Type of its numbers.
        dimensions: Number of its axes.
        is_written: Whether the function writes it; else it may be read-only.
        is_contiguous: Whether it has no gaps; else it may be a part of a larger array.
    """

    scalar: Scalar
    dimensions: int
    is_written: bool
    is_contiguous: bool = True


# A number, an array, or a tuple of types.
ArgumentType = Scalar | ArrayType | tuple["ArgumentType", ...]

NUMBER, WHOLE = np.float64, np.int64


def array_of(scalar: Scalar, dimensions: int = 1) -> ArrayType:
    """Return the type of a contiguous array that a function reads; it may be read-only."""
    return ArrayType(scalar, dimensions, is_written=False)


def written(scalar: Scalar, dimensions: int = 1) -> ArrayType:
    """Return the type of a contiguous array that a function writes."""
    return ArrayType(scalar, dimensions, is_written=True)


def compiled(*signatures: tuple[ArgumentType, ...]) -> Callable[[Function], Function]:
    """Compile a function for types of arguments, once for each machine: later runs load it from a file.

    The file lies beside the source, else in the user's cache folder; where neither can be written, or has no room, each run
    compiles.

    Args:
        *signatures: Types of the arguments in order; several where an argument may be of several types.
    """

    def defer(function: Function) -> Function:
        deferred = _CompiledFunction(function, signatures)
        _DEFINED.append(deferred)
        return cast(Function, deferred)

    return defer


def load_compiled(progress: Callable[[Sequence[Any]], Iterable[Any]] = iter) -> None:
    """Compile or load every function that has been defined so far.

    Args:
        progress: Progress bar around the functions.
    """
    for function in progress(tuple(_DEFINED)):
        function.native()


class _CompiledFunction:
    """A function that is compiled, or loaded, before its first call."""

    def __init__(
        self, function: Callable[..., Any], signatures: tuple[tuple[ArgumentType, ...], ...]
    ) -> None:
        self._function, self._signatures = function, signatures
        self._native: Callable[..., Any] | None = None
        update_wrapper(self, function)

    def __call__(self, *args: Any) -> Any:  # noqa: ANN401 - of any function
        return (self._native or self.native())(*args)

    def native(self) -> Callable[..., Any]:
        """Return the compiled function."""
        with _LOADING:
            if self._native is None:
                files = self._load_called()
                _name_by_contents(self._function, files)
                self._native = _compile(self._function, self._signatures)
                _FILES[id(self._native)] = files | {self._function.__code__.co_filename}
            return self._native

    def _load_called(self) -> set[str]:
        """Put compiled functions in the place of those that this one calls: numba knows no others.

        Returns:
            The files of these functions, and of those that they call in turn.
        """
        names, files = self._function.__globals__, set[str]()
        for name in self._function.__code__.co_names:
            called = names.get(name)
            if isinstance(called, _CompiledFunction):
                names[name] = called = called.native()
            files |= _FILES.get(id(called), set())
        return files


def _name_by_contents(function: Callable[..., Any], files: set[str]) -> None:
    """Let the name of a function, and so that of its cache, tell what else it is compiled of.

    numba compiles again where the file of the function has changed, but not where that of a function it calls has.
    """
    others = sorted(files - {function.__code__.co_filename})
    contents = [Path(file).read_bytes() for file in others if Path(file).is_file()]
    if contents:
        digest = hashlib.sha256(b"".join(contents)).hexdigest()[:8]
        function.__qualname__ = f"{function.__qualname__}_{digest}"


_DEFINED: list[_CompiledFunction] = []
_FILES: dict[int, set[str]] = {}  # of each compiled function and of those that it calls
_LOADING = threading.RLock()


def _compile(
    function: Callable[..., Any], signatures: tuple[tuple[ArgumentType, ...], ...]
) -> Callable[..., Any]:
    import numba

    _note_compilation()
    types = [tuple(map(_numba_type, signature)) for signature in signatures]
    options = {"nogil": True, "error_model": "numpy"}
    try:
        native: Callable[..., Any] = numba.njit(types, cache=True, **options)(function)
    except (RuntimeError, OSError):  # no folder or no room for the file
        native = numba.njit(types, **options)(function)
    return native


def _numba_type(argument: ArgumentType) -> Any:  # noqa: ANN401 - numba is not imported
    from numba import from_dtype, types

    if isinstance(argument, tuple):
        return types.Tuple(tuple(map(_numba_type, argument)))
    if isinstance(argument, ArrayType):
        scalar = from_dtype(np.dtype(argument.scalar))
        layout = "C" if argument.is_contiguous else "A"
        return types.Array(scalar, argument.dimensions, layout, readonly=not argument.is_written)
    return from_dtype(np.dtype(argument))


@cache
def _note_compilation() -> None:
    """Say when functions are being compiled, once."""
    from numba.core import event

    class CompilationNote(event.Listener):  # type: ignore[misc]
        def __init__(self) -> None:
            self._is_noted = False

        def on_start(self, event: event.Event) -> None:
            if not self._is_noted:
                log.warning("compiling functions for this machine, once: up to a minute")
            self._is_noted = True

        def on_end(self, event: event.Event) -> None:
            pass

    event.register("numba:compile", CompilationNote())
