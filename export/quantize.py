"""Static 8-bit quantization of weights and activations, calibrated on real inputs."""

import io
import logging
from collections.abc import Iterable, Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import onnx
from onnxruntime.quantization import (
    CalibrationDataReader,
    CalibrationMethod,
    QuantType,
    quantize_static,
)
from onnxruntime.quantization.shape_inference import quant_pre_process

from export.variants import Arrays
from perception.atomic_file import write_atomically

# By entropy is a third way of ONNX Runtime's, but with the bins that it counts in there is nothing to choose
# from: it comes to the same as minmax.
Scales = Literal["minmax", "percentile"]
_METHODS: dict[Scales, CalibrationMethod] = {
    "minmax": CalibrationMethod.MinMax,
    "percentile": CalibrationMethod.Percentile,
}


@dataclass(frozen=True)
class QuantizationConfig:
    """Parameters of the 8-bit quantization.

    Attributes:
        layers: Types of operators to quantize; the rest, such as the decoding of boxes, stays in full precision.
        ends: Type of the operator of which the first one stays in full precision, and the last one with all that
            follows from it; None for no such type.
        first: Whether the first one does.
        reduce_range: Whether weights have 7 bits, so that processors without VNNI, which add two products in 16 bits,
            do not saturate.
        scales: Scales from the range of all activations, minmax, or of most of them, percentile.
    """

    layers: tuple[str, ...] = ("Conv", "Gemm", "MatMul")  # where the time goes
    ends: str | None = None
    first: bool = True
    reduce_range: bool = False
    scales: Scales = "minmax"


def to_int8(
    model: bytes, batches: Iterable[Arrays], quantization: QuantizationConfig = QuantizationConfig()
) -> bytes:
    """Return a quantized ONNX file, calibrated on batches of real inputs.

    Weights have a scale for each channel; activations have static scales, since dynamic ones were measured to be
    seven times slower than no quantization. Weights are signed and activations are
    not: the only pair of types that ONNX Runtime has fast kernels for on processors with VNNI.
    """
    logger = logging.getLogger()
    level = logger.level
    with TemporaryDirectory() as folder:
        plain, prepared, quantised = (Path(folder, f"{n}.onnx") for n in ("a", "b", "c"))
        write_atomically(plain, model)
        # It advises through the root logger, and prints what it goes through.
        logger.setLevel(logging.ERROR)
        try:
            # The shapes that torch notes suffice; inferring them again fails on detectors.
            quant_pre_process(plain, prepared, skip_symbolic_shape=True)
            with redirect_stdout(io.StringIO()):
                quantize_static(
                    prepared,
                    quantised,
                    _Batches(batches),
                    op_types_to_quantize=list(quantization.layers),
                    nodes_to_exclude=_ends(prepared, quantization),
                    per_channel=True,
                    reduce_range=quantization.reduce_range,
                    activation_type=QuantType.QUInt8,
                    weight_type=QuantType.QInt8,
                    calibrate_method=_METHODS[quantization.scales],
                )
        finally:
            logger.setLevel(level)
        return _with_metadata(quantised, quantization)


def _with_metadata(file: Path, quantization: QuantizationConfig) -> bytes:
    """Return a file with the quantization in its metadata, and 8-bit inputs multiplied as they are."""
    made = onnx.load(file)
    _skip_casts(made.graph)
    metadata = {entry.key: entry.value for entry in made.metadata_props}
    onnx.helper.set_model_props(made, metadata | {"form": f"int8 {quantization.scales}"})
    return bytes(made.SerializeToString())


def _skip_casts(graph: Any) -> None:  # noqa: ANN401 - made by protobuf, without types
    """Quantize no 8-bit number that was cast to full precision as it is: two passes over the input less."""
    values = {entry.name: onnx.numpy_helper.to_array(entry) for entry in graph.initializer}
    types = {
        entry.name: entry.type.tensor_type.elem_type for entry in (*graph.input, *graph.value_info)
    }
    casts = {
        node.output[0]: node.input[0]
        for node in graph.node
        if node.op_type == "Cast" and types.get(node.input[0]) == onnx.TensorProto.UINT8
    }
    for node in graph.node:
        if node.op_type != "QuantizeLinear" or node.input[0] not in casts:
            continue
        if values[node.input[1]] == 1 and values[node.input[2]] == 0:
            node.op_type, node.input[:] = "Identity", [casts[node.input[0]]]
    used = {name for node in graph.node for name in node.input} | {one.name for one in graph.output}
    # ONNX Runtime runs what nothing uses.
    for node in [one for one in graph.node if casts.keys() & set(one.output) - used]:
        graph.node.remove(node)


def _ends(file: Path, quantization: QuantizationConfig) -> list[str]:
    """Name the first node of a type in the order of execution, and all from which no further one is reached."""
    nodes, operator = list(onnx.load(file).graph.node), quantization.ends
    firsts = [node.name for node in nodes if node.op_type == operator][:1]
    lasts, leading = [], set[str]()
    for node in reversed(nodes) if firsts else ():
        if not leading & set(node.output):
            lasts.append(node.name)
        if node.op_type == operator or leading & set(node.output):
            leading |= set(node.input)
    return [*(firsts if quantization.first else ()), *lasts]


class _Batches(CalibrationDataReader):  # type: ignore[misc]
    """Batches as ONNX Runtime asks for them."""

    def __init__(self, batches: Iterable[Arrays]) -> None:
        self._rest: Iterator[Arrays] = iter(batches)

    def get_next(self) -> dict[str, Any] | None:
        """Return the next batch, or None after the last."""
        batch = next(self._rest, None)
        return None if batch is None else dict(batch)
