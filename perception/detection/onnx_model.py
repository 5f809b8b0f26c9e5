"""A network as a file: checked when it is opened, ready for its first frame, arrays by name in and out."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.abc import Traversable
from importlib.resources import files
from typing import Any, Self, TypeVar

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from perception.errors import ModelError

Array = NDArray[Any]
Value = TypeVar("Value")
# As ONNX Runtime names the types of numbers that go in.
_TYPE_NAMES: Mapping[type[np.generic], str] = {
    np.uint8: "tensor(uint8)",
    np.float32: "tensor(float)",
}


@dataclass(frozen=True)
class ModelInput:
    """What goes into a network.

    Attributes:
        type: of its numbers, uint8 or float32; None of any other.
        shape: None along an axis of any length.
    """

    type: type[np.generic] | None
    shape: tuple[int | None, ...]

    def __str__(self) -> str:
        """Write it as in: uint8 any x 3 x 66 x 112."""
        name = self.type.__name__ if self.type else "another type"
        return f"{name} {' x '.join(str(n or 'any') for n in self.shape)}"

    def accepts(self, other: "ModelInput") -> bool:
        """Tell whether the other is as this one asks for."""
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
    """What a caller needs a model file to be.

    Attributes:
        metadata: metadata that have to be there and have this value.
        required_keys: names of metadata that have to be there, whatever their value.
        inputs: by name; the file must have these and no others.
        outputs: names.
        warmup_rows: that go in at once, as many as a frame has candidates: memory for them is set aside
            before the first frame.
    """

    metadata: Mapping[str, str]
    required_keys: tuple[str, ...] = ()
    inputs: Mapping[str, ModelInput] = field(default_factory=dict)
    outputs: tuple[str, ...] = ()
    warmup_rows: int = 32

    def with_metadata(self, metadata: Mapping[str, str]) -> Self:
        """Return the same contract with further facts, or others in their place."""
        return replace(self, metadata={**self.metadata, **metadata})


def shipped_model(name: str) -> Traversable:
    """Return the model file of that name that comes with the package."""
    return files("perception.detection") / "weights" / f"{name}.onnx"


class OnnxModel:
    """A network in ONNX Runtime, on the CPU."""

    def __init__(self, file: Traversable, contract: ModelContract, threads: int = 2) -> None:
        """Open and check the file, and run it once, since the first run is slow.

        Args:
            file: a path, or what `shipped_model` returns.
            contract: what it has to fit.
            threads: that share one run.

        Raises:
            ModelError: there is no such file, it is no ONNX model, or one made for something else.
        """
        self.name = file.name
        """Of the file."""
        content = _content(file)
        self.fingerprint = hashlib.blake2b(content, digest_size=8).hexdigest()
        """What tells the file from others."""
        self._session = _open(file, content, threads)
        self.metadata: Mapping[str, str] = dict(self._session.get_modelmeta().custom_metadata_map)
        """What the file says of itself."""
        self.inputs = {entry.name: _input_of(entry) for entry in self._session.get_inputs()}
        """What goes in, by name."""
        self.output_shapes = {entry.name: _shape_of(entry) for entry in self._session.get_outputs()}
        """What comes out, by name; None along an axis of any length."""
        self._check_metadata(contract)
        self._check_interface(contract)
        self(self._blank_inputs(contract.warmup_rows))

    def __call__(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Run the network once.

        Raises:
            ModelError: the inputs are not the network's, or what comes out is not finite.
        """
        try:
            arrays = self._session.run(list(self.output_shapes), dict(inputs))
        except Exception as error:  # ONNX Runtime's errors have no base of their own
            shapes = ", ".join(f"{name} {array.shape}" for name, array in inputs.items())
            raise ModelError(
                self.name,
                expected=f"to run on {shapes}",
                found=_first_line(error),
            ) from error
        outputs = dict(zip(self.output_shapes, arrays, strict=True))
        for name, array in outputs.items():
            if not np.isfinite(array).all():
                raise ModelError(
                    self.name,
                    expected=f"finite numbers in output {name}",
                    found=f"{int((~np.isfinite(array)).sum())} that are NaN or infinite",
                    advice="train it anew, or export an earlier checkpoint",
                )
        return outputs

    def metadata_choice(self, name: str, known: Sequence[Value]) -> Value:
        """Return what the file says of itself under a name, where it is something that we know.

        Raises:
            ModelError: it is something else.
        """
        value = self.metadata[name]
        for one in known:
            if one == value:
                return one
        raise ModelError(self.name, expected=f"{name} {' or '.join(map(str, known))}", found=value)

    def _check_metadata(self, contract: ModelContract) -> None:
        for name in (*contract.metadata, *contract.required_keys):
            required = contract.metadata.get(name)
            found = self.metadata.get(name)
            if found is None or (required is not None and found != required):
                raise ModelError(
                    self.name,
                    expected=f"{name} {required}" if required else f"{name} in its metadata",
                    found=found or "no such entry in its metadata",
                    advice="give a model that `trifuse export` wrote for this detector",
                )

    def _check_interface(self, contract: ModelContract) -> None:
        fits = self.inputs.keys() == contract.inputs.keys() and all(
            required.accepts(self.inputs[name]) for name, required in contract.inputs.items()
        )
        if not fits:
            raise ModelError(
                self.name,
                expected=f"inputs {_listed(contract.inputs)}",
                found=_listed(self.inputs),
            )
        if missing := [name for name in contract.outputs if name not in self.output_shapes]:
            raise ModelError(
                self.name,
                expected=f"an output {missing[0]}",
                found=", ".join(self.output_shapes),
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
            advice="check its name, or make it with `trifuse export`",
        )
    return file.read_bytes()


def _open(file: Traversable, content: bytes, threads: int) -> Any:  # noqa: ANN401 - ONNX Runtime has no types
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    # Threads that wait for the next frame would keep the other stages from the cores: asleep, they
    # cost half the processor time and no run is slower.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 3
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime's errors have no base of their own
        raise ModelError(
            str(file),
            expected="a whole ONNX model",
            found=_first_line(error),
            advice="write it anew with `trifuse export`",
        ) from error


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0].rstrip(".")


def _input_of(entry: Any) -> ModelInput:  # noqa: ANN401 - ONNX Runtime has no types
    types = {name: number for number, name in _TYPE_NAMES.items()}
    return ModelInput(types.get(entry.type), _shape_of(entry))


def _shape_of(entry: Any) -> tuple[int | None, ...]:  # noqa: ANN401 - ONNX Runtime has no types
    return tuple(n if isinstance(n, int) else None for n in entry.shape)


def _listed(inputs: Mapping[str, ModelInput]) -> str:
    return ", ".join(f"{name} {entry}" for name, entry in inputs.items())
