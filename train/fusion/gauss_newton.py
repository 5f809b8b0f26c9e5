"""JᵀJ and Jᵀr of a network of fully connected layers, without its Jacobian.

A residual goes with the weight from value v to neuron w as back[w] x value[v]. So for two layers

    sum over residuals  back[w] value[v] back'[w'] value'[v']
      = sum over rows  (sum over outputs  back[w] back'[w'])  (value[v] value'[v'])

which is a product of two matrices: one has the pairs of neurons, the other the pairs of values, of all rows.
Within one layer both are symmetric.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import torch
from torch import Tensor

from perception.types import Float64, Int


@dataclass(frozen=True)
class LayerFactors:
    """Derivatives of the residuals of R rows by the parameters of a layer of W neurons.

    Attributes:
        back: (outputs, W, R) derivatives of the residuals by the inputs of the neurons.
        values: (V, R) inputs of the layer, the last of them 1 for the bias.
    """

    back: Tensor
    values: Tensor


@dataclass(frozen=True)
class _Pairs:
    """P pairs of A and B items; of the same items, each unordered pair once.

    Attributes:
        first: (P,) first item of each pair.
        second: (P,) second item of each pair.
        number: (A, B) number of the pair of two items.
    """

    first: Tensor
    second: Tensor
    number: Tensor

    @classmethod
    def of(cls, first: int, second: int, *, is_same: bool) -> Self:
        """Count them."""
        if not is_same:
            number = torch.arange(first * second).view(first, second)
            ones = torch.arange(first).repeat_interleave(second)
            others = torch.arange(second).repeat(first)
            return cls(ones, others, number)
        ones, others = torch.triu_indices(first, first)
        number = torch.zeros(first, first, dtype=torch.int64)
        number[ones, others] = number[others, ones] = torch.arange(len(ones))
        return cls(ones, others, number)


class _Block:
    """The curvature between the parameters of two layers, of which the second may be the first."""

    def __init__(self, one: torch.Size, other: torch.Size, *, is_same: bool) -> None:
        """Begin with no rows.

        Args:
            one: (W, V) shape of the first layer, with a bias among the values.
            other: Shape of the second layer.
            is_same: Whether both are the same layer.
        """
        self._neurons = _Pairs.of(one[0], other[0], is_same=is_same)
        self._values = _Pairs.of(one[1], other[1], is_same=is_same)
        shape = len(self._neurons.first), len(self._values.first)
        self._sums = torch.zeros(shape, dtype=torch.float64)

    def add(self, one: LayerFactors, other: LayerFactors) -> None:
        neurons, values = self._neurons, self._values
        across = (one.back[:, neurons.first] * other.back[:, neurons.second]).sum(dim=0)
        pairs = one.values[values.first] * other.values[values.second]
        self._sums.addmm_(across, pairs.T)

    @property
    def normal_matrix(self) -> Tensor:
        """(W V, W' V')."""
        spread = self._sums[self._neurons.number][:, :, self._values.number]  # (W, W', V, V')
        return spread.permute(0, 2, 1, 3).flatten(0, 1).flatten(1)


class GaussNewtonSums:
    """Sums over rows that come part by part.

    Parameters are in the order of torch: layer after layer, the weights neuron by neuron, then the biases.
    """

    def __init__(self, weight_shapes: Sequence[torch.Size]) -> None:
        """Begin with no rows, for layers of (W, V) weights without their biases."""
        shapes = [torch.Size((neurons, values + 1)) for neurons, values in weight_shapes]
        self._slopes = [torch.zeros(shape, dtype=torch.float64) for shape in shapes]
        self._blocks = {
            (one, other): _Block(shapes[one], shapes[other], is_same=one == other)
            for one in range(len(shapes))
            for other in range(one, len(shapes))
        }
        ends = np.cumsum([shape.numel() for shape in shapes])
        self._places = [
            _places(shape) + int(end) - shape.numel()
            for shape, end in zip(shapes, ends, strict=True)
        ]
        self._count = int(ends[-1])

    def add(self, residuals: Tensor, factors: Sequence[LayerFactors]) -> None:
        """Add R rows by their (outputs, R) residuals and the factors of each layer."""
        for slope, factor in zip(self._slopes, factors, strict=True):
            slope.addmm_((factor.back * residuals[:, None]).sum(dim=0), factor.values.T)
        for (one, other), block in self._blocks.items():
            block.add(factors[one], factors[other])

    @property
    def gradient(self) -> Float64:
        """(P,) Jᵀr."""
        found = np.empty(self._count)
        for places, slope in zip(self._places, self._slopes, strict=True):
            found[places] = slope.flatten().numpy()
        return found

    @property
    def normal_matrix(self) -> Float64:
        """(P, P) JᵀJ."""
        found = np.empty((self._count, self._count))
        for (one, other), block in self._blocks.items():
            between = block.normal_matrix.numpy()
            found[np.ix_(self._places[one], self._places[other])] = between
            found[np.ix_(self._places[other], self._places[one])] = between.T
        return found


def _places(shape: torch.Size) -> Int:
    """Return (W V,) where torch keeps the parameters of a layer, whose biases come last."""
    neurons, values = shape[0], shape[1] - 1
    weights = np.arange(neurons * values).reshape(neurons, values)
    biases = neurons * values + np.arange(neurons)
    return np.column_stack([weights, biases]).ravel()
