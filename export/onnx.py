"""Conversion of a torch module to an ONNX file with metadata."""

import io
import logging
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from typing import Any

import onnx
import torch
from torch import Tensor, nn

from perception.errors import ModelError

# What torch's exporter writes without conversion, and every ONNX Runtime of the last years reads.
OPSET = 18
_IR_VERSION = 10


@dataclass(frozen=True)
class Exportable:
    """A network and how a file shall offer it.

    Attributes:
        module: Module in evaluation mode; takes the inputs in their order, returns a tensor for each output.
        inputs: Example of each input by name, (M, ...) with the same M of at least 2. M is free in the file.
        outputs: Names of the outputs.
        metadata: Metadata of the model file.
        side_step: Number that divides the lengths of the third and fourth axis, which then are free in the file, too;
            None for those of the examples.
    """

    module: nn.Module
    inputs: Mapping[str, Tensor]
    outputs: tuple[str, ...]
    metadata: Mapping[str, str]
    side_step: int | None = None

    @property
    def free_axes(self) -> dict[int, object]:
        """Return the free axes of every input."""
        axes: dict[int, object] = {0: torch.export.Dim("rows")}
        if self.side_step is not None:
            axes |= {2: self.side_step * torch.export.Dim("height_steps", min=1)}
            axes |= {3: self.side_step * torch.export.Dim("width_steps", min=1)}
        return axes


def to_onnx(exportable: Exportable) -> bytes:
    """Return the ONNX file, weights and metadata included.

    Raises:
        ModelError: the module can only take as many rows as the examples have, or inputs of their size.
    """
    axes = exportable.free_axes
    with _quiet(), torch.no_grad():
        program = torch.onnx.export(
            exportable.module.eval(),
            tuple(exportable.inputs.values()),
            input_names=list(exportable.inputs),
            output_names=list(exportable.outputs),
            dynamic_shapes=tuple(axes for _ in exportable.inputs),
            opset_version=OPSET,
            dynamo=True,
            verbose=False,
        )
    assert program is not None  # the exporter in use always returns one
    model = program.model_proto
    _require_free_axes(model, axes)
    model.ir_version = min(model.ir_version, _IR_VERSION)
    _forget_source(model)
    onnx.helper.set_model_props(model, dict(exportable.metadata))
    onnx.checker.check_model(model, full_check=True)
    return bytes(model.SerializeToString())


def _require_free_axes(model: Any, axes: Iterable[int]) -> None:  # noqa: ANN401 - made by protobuf, without types
    """Validate that the exporter did not fix the length of an axis to that of the examples."""
    for entry in model.graph.input:
        fixed = [axis for axis in axes if not entry.type.tensor_type.shape.dim[axis].dim_param]
        if fixed:
            raise ModelError(
                "export",
                expected=f"any length of axis {fixed[0]} of input {entry.name}",
                found="a network that takes only its example's",
                advice="let it ask for shape[0] in place of len(), and reshape to -1 rows",
            )


def _forget_source(model: Any) -> None:  # noqa: ANN401 - made by protobuf, without types
    """Drop the exporter's notes on Python lines, which hold paths of this machine."""
    for part in (model.graph, *model.graph.node, *model.graph.input, *model.graph.output):
        del part.metadata_props[:]
        part.doc_string = ""
    for part in (*model.graph.value_info, *model.graph.initializer):
        del part.metadata_props[:]


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep the exporter's progress and warnings of its own internals off the screen."""
    with warnings.catch_warnings(), redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        loggers = [logging.getLogger(name) for name in ("torch", "onnxscript", "onnx_ir")]
        levels = [logger.level for logger in loggers]
        for logger in loggers:
            logger.setLevel(logging.ERROR)
        try:
            yield
        finally:
            for logger, level in zip(loggers, levels, strict=True):
                logger.setLevel(level)
