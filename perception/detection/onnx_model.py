"""A network in an ONNX file: validated when it is opened, warmed up, with arrays by name as inputs and outputs."""

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any, Self, TypeVar

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from perception.detection.onnx_content import has_external_data
from perception.errors import ModelError

Array = NDArray[Any]
Value = TypeVar("Value")
# Names of the input types in ONNX Runtime.
_TYPE_NAMES: Mapping[type[np.generic], str] = {
    np.uint8: "tensor(uint8)",
    np.float16: "tensor(float16)",
    np.float32: "tensor(float)",
    np.int32: "tensor(int32)",
    np.int64: "tensor(int64)",
}


@dataclass(frozen=True)
class ModelInput:
    """An input of a network.

    Attributes:
        type: Type of the numbers, uint8, float16, float32, int32 or int64; None for any other.
        shape: Length of each axis, None for any length.
    """

    type: type[np.generic] | None
    shape: tuple[int | None, ...]

    def __str__(self) -> str:
        """Return type and shape as text, such as `uint8 any x 3 x 66 x 112`."""
        name = self.type.__name__ if self.type else "another type"
        return f"{name} {' x '.join(str(n or 'any') for n in self.shape)}"

    def accepts(self, other: "ModelInput") -> bool:
        """Return whether another input has the type and shape that this one requires."""
        return (
            other.type is self.type
            and len(other.shape) == len(self.shape)
            and all(
                required in (None, found_length)
                for required, found_length in zip(self.shape, other.shape, strict=True)
            )
        )


@dataclass(frozen=True)
class ModelContract:
    """Requirements on a model file.

    Attributes:
        metadata: Metadata that the file must have with these values.
        required_keys: Metadata that the file must have with any value.
        inputs: Inputs by name; the file must have exactly these.
        outputs: Names of outputs that the file must have.
        warmup_rows: Batch size of the run on opening, such as the number of proposals of a frame, so that its
            memory is allocated before the first frame.
    """

    metadata: Mapping[str, str]
    required_keys: tuple[str, ...] = ()
    inputs: Mapping[str, ModelInput] = field(default_factory=dict)
    outputs: tuple[str, ...] = ()
    warmup_rows: int = 32

    def with_metadata(self, metadata: Mapping[str, str]) -> Self:
        """Return the contract with added or replaced metadata."""
        return replace(self, metadata={**self.metadata, **metadata})


def shipped_model(name: str) -> Traversable:
    """Return a model file of this package by its name without suffix."""
    return files("perception.detection") / "weights" / f"{name}.onnx"


class OnnxModel:
    """A network in ONNX Runtime, on the CPU."""

    def __init__(
        self,
        file: Traversable,
        contract: ModelContract | None = None,
        threads: int = 2,
        *,
        free_axes: tuple[str, tuple[int, ...]] | None = None,
    ) -> None:
        """Open and validate the file, and run the network once, since the first run is slow.

        Args:
            file: Path of the file, or a model of this package.
            contract: Requirements on the file; None for a file of any kind, which is not run.
            threads: Number of threads of one run.
            free_axes: Name of an input and its axes that may have any length, also where the file states one.

        Raises:
            ModelError: the file is missing, is no ONNX model, or does not meet the requirements.
        """
        self.name = file.name
        """Name of the file."""
        content = _content(file)
        _require_self_contained(file, content)
        self.fingerprint = hashlib.blake2b(content, digest_size=8).hexdigest()
        """Hash of the file's content."""
        with _complete(file):
            content = _without_lengths(content, *free_axes) if free_axes else content
            self._session = _open(content, threads)
            meta, inputs = self._session.get_modelmeta(), self._session.get_inputs()
            self.metadata: Mapping[str, str] = dict(meta.custom_metadata_map)
            """Metadata of the file."""
            self.inputs = {entry.name: _input_of(entry) for entry in inputs}
            """Inputs by name."""
            outputs = self._session.get_outputs()
            self.output_shapes = {
                entry.name: _shape_of(entry) for entry in outputs if _is_array_of_numbers(entry)
            }
            """Shapes of the outputs by name; None for an axis of any length."""
        if contract is not None:
            self.check(contract)
            self(self._blank_inputs(contract.warmup_rows))

    def __call__(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Run the network once; inputs without rows have outputs without rows.

        Raises:
            ModelError: the inputs do not fit the network, or an output is not finite.
        """
        if any(array.shape[:1] == (0,) for array in inputs.values()):
            # Some releases of ONNX Runtime multiply no matrix without rows.
            return {
                name: np.zeros([length or 0 for length in shape], np.float32)
                for name, shape in self.output_shapes.items()
            }
        names = list(self.output_shapes)
        try:
            arrays = self._session.run(names, dict(inputs)) if names else []
        except Exception as error:  # ONNX Runtime's errors have no base of their own
            shapes = ", ".join(f"{name} {array.shape}" for name, array in inputs.items())
            raise ModelError(
                self.name, expected=f"to run on {shapes}", found=_first_line(error)
            ) from error
        outputs = dict(zip(self.output_shapes, arrays, strict=True))
        for name, array in outputs.items():
            if not np.isfinite(array).all():
                raise ModelError(
                    self.name,
                    expected=f"finite numbers in output {name}",
                    found=f"{int((~np.isfinite(array)).sum())} that are NaN or infinite",
                    advice="retrain the network, or export an earlier checkpoint",
                )
        return outputs

    def leave_out(self, names: Iterable[str]) -> None:
        """Return some outputs no longer."""
        left_out = {*names}
        self.output_shapes = {
            name: shape for name, shape in self.output_shapes.items() if name not in left_out
        }

    def metadata_choice(self, name: str, known: Sequence[Value]) -> Value:
        """Return a metadata entry of the file that has to be one of the known values.

        Raises:
            ModelError: the entry has another value.
        """
        value = self.metadata[name]
        for one in known:
            if one == value:
                return one
        raise ModelError(self.name, expected=f"{name} {' or '.join(map(str, known))}", found=value)

    def check(self, contract: ModelContract) -> None:
        """Validate metadata, inputs and outputs.

        Raises:
            ModelError: the file does not meet the requirements.
        """
        self._check_metadata(contract)
        self._check_interface(contract)

    def _check_metadata(self, contract: ModelContract) -> None:
        for name in (*contract.metadata, *contract.required_keys):
            required = contract.metadata.get(name)
            found = self.metadata.get(name)
            if found is None or (required is not None and found != required):
                raise ModelError(
                    self.name,
                    expected=f"{name} {required}" if required else f"{name} in its metadata",
                    found=found or "no such entry in its metadata",
                    advice="use a model that `trifuse export` wrote for this detector",
                )

    def _check_interface(self, contract: ModelContract) -> None:
        fits = self.inputs.keys() == contract.inputs.keys() and all(
            required.accepts(self.inputs[name]) for name, required in contract.inputs.items()
        )
        if not fits:
            raise ModelError(
                self.name, expected=f"inputs {_listed(contract.inputs)}", found=_listed(self.inputs)
            )
        if missing := [name for name in contract.outputs if name not in self.output_shapes]:
            raise ModelError(
                self.name, expected=f"an output {missing[0]}", found=", ".join(self.output_shapes)
            )

    def _blank_inputs(self, rows: int) -> dict[str, Array]:
        return {
            name: np.zeros([n or rows for n in entry.shape], entry.type)
            for name, entry in self.inputs.items()
        }


def _content(file: Traversable) -> bytes:
    if not file.is_file():
        raise ModelError(
            file.name,
            expected="a model file",
            found=f"no file {file}",
            advice="check the path, or create the file with `trifuse export`",
        )
    return file.read_bytes()


def _require_self_contained(file: Traversable, content: bytes) -> None:
    """Validate that a model reads no file beside its own: it may name any file of this machine.

    Raises:
        ModelError: It has tensors elsewhere, or is no ONNX file.
    """
    try:
        if not has_external_data(content):
            return
        found, advice = "tensors in files beside it", "save it with all its weights in one file"
    except ValueError as error:
        found, advice = str(error), "export the model again with `trifuse export`"
    raise ModelError(str(file), expected="a complete ONNX model", found=found, advice=advice)


def _without_lengths(content: bytes, name: str, free_axes: Sequence[int]) -> bytes:
    """Return a model with axes of an input that may have any length, and with outputs of any shape."""
    import onnx

    model = onnx.load_from_string(content)
    for entry in model.graph.input:
        if entry.name == name:
            for axis in free_axes:
                entry.type.tensor_type.shape.dim[axis].dim_param = f"{name}_{axis}"
    for entry in model.graph.output:
        for number, axis in enumerate(entry.type.tensor_type.shape.dim):
            axis.dim_param = f"{entry.name}_{number}"
    del model.graph.value_info[:]  # the shapes between, which follow from the size
    return bytes(model.SerializeToString())


@contextmanager
def _complete(file: Traversable) -> Iterator[None]:
    """Name a file whose content a library refuses, or whose names are no text.

    Raises:
        ModelError: It is no complete ONNX model.
    """
    try:
        yield
    except Exception as error:  # ONNX Runtime's errors have no base of their own
        raise ModelError(
            str(file),
            expected="a complete ONNX model",
            found=_first_line(error),
            advice="export the model again, by `trifuse export` or with operators of ONNX alone",
        ) from error


def _open(content: bytes, threads: int) -> Any:  # noqa: ANN401 - ONNX Runtime has no types
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    # One memory arena for all networks: with one each 17 MiB more; without any 15 MiB more and five times the page faults.
    _register_shared_arena()
    options.add_session_config_entry("session.use_env_allocators", "1")
    # Threads that spin while they wait for the next frame take the cores from the other stages: without
    # spinning, processor time halves and no run is slower.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 4  # errors are raised, and need no line of their own
    # Without its fallback, which prints a banner and tries the same once more.
    return onnxruntime.InferenceSession(
        content, options, providers=["CPUExecutionProvider"], enable_fallback=0
    )


@cache
def _register_shared_arena() -> None:
    """Make the memory arena of all networks of the process, which grows by what is asked of it, not by powers of two."""
    info = onnxruntime.OrtMemoryInfo(
        "Cpu", onnxruntime.OrtAllocatorType.ORT_ARENA_ALLOCATOR, 0, onnxruntime.OrtMemType.DEFAULT
    )
    settings = {
        "max_mem": 0,  # no limit
        "arena_extend_strategy": 1,  # as requested
        "initial_chunk_size_bytes": -1,
        "max_dead_bytes_per_chunk": -1,
    }
    onnxruntime.create_and_register_allocator(info, onnxruntime.OrtArenaCfg(settings))


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0].rstrip(".")


def _input_of(entry: Any) -> ModelInput:  # noqa: ANN401 - ONNX Runtime has no types
    types = {name: number for number, name in _TYPE_NAMES.items()}
    return ModelInput(types.get(entry.type), _shape_of(entry))


def _is_array_of_numbers(entry: Any) -> bool:  # noqa: ANN401 - ONNX Runtime has no types
    return str(entry.type).startswith("tensor(") and entry.type != "tensor(string)"


def _shape_of(entry: Any) -> tuple[int | None, ...]:  # noqa: ANN401 - ONNX Runtime has no types
    return tuple(n if isinstance(n, int) else None for n in entry.shape)


def _listed(inputs: Mapping[str, ModelInput]) -> str:
    return ", ".join(f"{name} {entry}" for name, entry in inputs.items())
