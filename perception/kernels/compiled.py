"""The decorator of compiled functions, and the types of their arguments."""

import logging
from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba import types
from numba.core import event

Function = TypeVar("Function", bound=Callable[..., Any])
log = logging.getLogger(__name__)

NUMBER, WHOLE = types.float64, types.int64


def array_of(kind: types.Type, dimensions: int = 1) -> types.Array:
    """Return the type of a contiguous array that a function reads; it may be read-only."""
    return types.Array(kind, dimensions, "C", readonly=True)


def written(kind: types.Type, dimensions: int = 1) -> types.Array:
    """Return the type of a contiguous array that a function writes."""
    return types.Array(kind, dimensions, "C")


def compiled(*signatures: tuple[types.Type, ...]) -> Callable[[Function], Function]:
    """Compile a function for types of arguments, once for each machine: later runs load it from a file.

    The file lies beside the source, else in the user's cache folder; where neither can be written, or has no room, each run
    compiles.

    Functions are compiled where they are defined, so that no frame waits for it.

    Args:
        *signatures: Types of the arguments in order; several where an argument may be of several types.
    """

    def compile_function(function: Function) -> Function:
        options = {"nogil": True, "error_model": "numpy"}
        try:
            native: Function = numba.njit(list(signatures), cache=True, **options)(function)
        except (RuntimeError, OSError):  # no folder or no room for the file
            native = numba.njit(list(signatures), **options)(function)
        return native

    return compile_function


class _CompilationNote(event.Listener):  # type: ignore[misc]
    """Says once that functions are being compiled."""

    def __init__(self) -> None:
        self._is_noted = False

    def on_start(self, event: event.Event) -> None:
        if not self._is_noted:
            log.warning("compiling functions for this machine, once: up to a minute")
        self._is_noted = True

    def on_end(self, event: event.Event) -> None:
        pass


event.register("numba:compile", _CompilationNote())
