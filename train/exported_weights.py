"""Weights of a network read back from its model file, in full precision or of 8 bits.

An export folds a normalisation into the convolution before it. Read back, the convolution has what is in the file, and the
normalisation is the identity but for its bias; a network that has one may not train its statistics.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn

from perception.errors import ModelError, UsageError
from perception.types import Float32
from train.networks.bev_centers import fold

Network = TypeVar("Network", bound=nn.Module)
_DEQUANTIZED = "_DequantizeLinear_Output"  # suffix of weights, which quantization adds


def load_exported(
    file: Path, kind: str, make: Callable[[Mapping[str, str]], Network], prefix: str = ""
) -> tuple[Network, dict[str, str]]:
    """Return the network of a model file in evaluation mode, and the metadata that the file states.

    Args:
        file: Model file.
        kind: Kind of model, its entry `kind`.
        make: Function from metadata to a network with random weights.
        prefix: What the names of its weights begin with in the file.

    Raises:
        ModelError: the file is missing, damaged, or of another network.
    """
    expected = f"a model file of {kind}"
    try:
        model = onnx.load(file)
    except Exception as error:  # protobuf's errors have no base of their own
        found = "a file that cannot be read" if file.is_file() else "no such file"
        raise ModelError(file, expected=expected, found=found) from error
    stated = {entry.key: entry.value for entry in model.metadata_props}
    if stated.get("kind") != kind:
        raise ModelError(file, expected=expected, found=f"one of {stated.get('kind')}")
    try:
        network = make(stated)
        network.load_state_dict(_state(network, _layers(model.graph), prefix))
    except (KeyError, RuntimeError, TypeError, UsageError, ValueError) as error:
        found = f"others ({str(error).splitlines()[0]})"
        raise ModelError(file, expected=f"weights of this {kind}", found=found) from error
    return network.eval(), stated


class _Layer(NamedTuple):
    weight: Float32
    bias: Float32


def _layers(graph: onnx.GraphProto) -> dict[str, _Layer]:
    """Return the convolutions and products of a graph by the name of their weights, those of 8 bits in full precision."""
    values = {entry.name: numpy_helper.to_array(entry) for entry in graph.initializer}
    for node in graph.node:
        if node.op_type == "DequantizeLinear" and set(node.input) <= values.keys():
            quantized, scale, zero = (values[name] for name in node.input)
            shape = (-1,) + (1,) * (quantized.ndim - 1)  # a scale for each channel
            number = quantized.astype(np.float32) - zero.astype(np.float32).reshape(shape)
            values[node.output[0]] = number * scale.reshape(shape)
    layers = {}
    for node in graph.node:
        if node.op_type in ("Conv", "Gemm"):
            # Biases that are equal are one in the file, and those that are 0 may be left out.
            weight, *biases = (values[name] for name in node.input[1:])
            bias = biases[0] if biases else np.zeros(len(weight), np.float32)
            layers[node.input[1].removesuffix(_DEQUANTIZED)] = _Layer(weight, bias)
    return layers


def _state(network: nn.Module, layers: Mapping[str, _Layer], prefix: str) -> dict[str, Tensor]:
    """Return the state of a network by the layers of its exported file."""
    fold(network)
    state = network.state_dict()
    for name, module in network.named_modules():
        if isinstance(module, nn.BatchNorm2d):
            layer = layers[f"{prefix}{name.rpartition('.')[0]}.0.weight"]
            state[f"{name}.bias"] = torch.tensor(layer.bias)
        elif isinstance(module, nn.Conv2d | nn.Linear):
            layer = layers[f"{prefix}{name}.weight"]
            state[f"{name}.weight"] = torch.tensor(layer.weight)
            if module.bias is not None:
                state[f"{name}.bias"] = torch.tensor(layer.bias)
    return state
