"""Weights and what flows between the layers as 8-bit numbers, scaled by what real inputs bring about."""

import logging
from collections.abc import Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from onnxruntime.quantization import CalibrationDataReader, QuantType, quantize_static
from onnxruntime.quantization.shape_inference import quant_pre_process

from export.parity import Arrays

# Where the time goes; the rest stays as it is, the decoding of boxes above all.
_LAYERS = ["Conv", "Gemm", "MatMul"]


def to_int8(model: bytes, batches: Iterable[Arrays]) -> bytes:
    """Return a quantised form of an ONNX file, its scales from batches of real inputs.

    A scale for each channel of the weights, none that changes from input to input: finding those at run
    time was measured and is seven times slower than no quantisation.
    """
    logger = logging.getLogger()
    level = logger.level
    with TemporaryDirectory() as folder:
        plain, prepared, quantised = (Path(folder, f"{n}.onnx") for n in ("a", "b", "c"))
        plain.write_bytes(model)
        logger.setLevel(logging.ERROR)  # it advises through the root logger
        try:
            quant_pre_process(plain, prepared)
            quantize_static(
                prepared,
                quantised,
                _Batches(batches),
                op_types_to_quantize=_LAYERS,
                per_channel=True,
                activation_type=QuantType.QUInt8,
                weight_type=QuantType.QInt8,
            )
        finally:
            logger.setLevel(level)
        return quantised.read_bytes()


class _Batches(CalibrationDataReader):  # type: ignore[misc]
    """Batches as ONNX Runtime asks for them."""

    def __init__(self, batches: Iterable[Arrays]) -> None:
        self._rest: Iterator[Arrays] = iter(batches)

    def get_next(self) -> dict[str, Any] | None:
        """Return the next batch, or None after the last."""
        batch = next(self._rest, None)
        return None if batch is None else dict(batch)
