"""JᵀJ and Jᵀr of the fusion's network over many rows, without its Jacobian, on the device of the network.

A residual changes with the weight from value v to neuron w by back[w] x value[v]. So for two layers

    sum over residuals  back[w] value[v] back'[w'] value'[v']
      = sum over rows  (sum over outputs  back[w] back'[w'])  (value[v] value'[v'])

which is a product of two matrices: one has the pairs of neurons, the other the pairs of values, of all rows.
Within one layer both are symmetric.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import torch
from torch import Tensor
from torch.nn import functional

from train.fusion.levenberg_marquardt import NormalEquations
from train.fusion.network import FusionNetwork, RescoringMlp

Rows = Sequence[Tensor]
"""(T, F) features, (T, 3) targets and (T, 3) weights."""

# Rows at a time: on a CPU what its cache holds, on a GPU what keeps it busy within 1 GB.
_CPU_ROWS, _GPU_ROWS = 512, 16_384
_MIN_SCORE = 1e-6  # of a probability whose logarithm is taken


@dataclass(frozen=True)
class _LayerFactors:
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
    def of(cls, first: int, second: int, device: torch.device, *, is_same: bool) -> Self:
        """Number them."""
        if not is_same:
            number = torch.arange(first * second, device=device).view(first, second)
            ones = torch.arange(first, device=device).repeat_interleave(second)
            others = torch.arange(second, device=device).repeat(first)
            return cls(ones, others, number)
        ones, others = torch.triu_indices(first, first, device=device)
        number = ones.new_zeros(first, first)
        number[ones, others] = number[others, ones] = torch.arange(len(ones), device=device)
        return cls(ones, others, number)


class _Block:
    """JᵀJ between the parameters of two layers, of which the second may be the first."""

    def __init__(self, one: Tensor, other: Tensor) -> None:
        """Start without rows, for layers by their (W, V) weights without biases."""
        is_same, device = one is other, one.device
        self._neurons = _Pairs.of(len(one), len(other), device, is_same=is_same)
        self._values = _Pairs.of(one.shape[1] + 1, other.shape[1] + 1, device, is_same=is_same)
        self._sums = one.new_zeros(len(self._neurons.first), len(self._values.first))

    def add(self, one: _LayerFactors, other: _LayerFactors) -> None:
        """Add R rows."""
        neurons, values = self._neurons, self._values
        across = one.back[:, neurons.first].mul_(other.back[:, neurons.second]).sum(dim=0)
        pairs = one.values[values.first].mul_(other.values[values.second])
        self._sums.addmm_(across, pairs.T)

    @property
    def matrix(self) -> Tensor:
        """(W (V + 1), W' (V' + 1)) sums."""
        spread = self._sums[self._neurons.number][:, :, self._values.number]  # (W, W', V, V')
        return spread.permute(0, 2, 1, 3).flatten(0, 1).flatten(1)


def weighted_squares(network: FusionNetwork, rows: Rows) -> Tensor:
    """Return the sum of the weighted squared errors, and the sum of the weights."""
    features, targets, weights = rows
    squares = weights * (network(features) - targets).square()
    return torch.stack([squares.sum(), weights.sum()])


def weighted_entropy(network: FusionNetwork, rows: Rows) -> Tensor:
    """Return the sum of the weighted cross-entropies of probabilities, and the sum of the weights.

    Near 0 and 1, where boxes are ranked, the cross-entropy has a gradient, and the squared error has none.
    """
    features, targets, weights = rows
    scores = network(features).clamp(_MIN_SCORE, 1 - _MIN_SCORE)
    entropy = functional.binary_cross_entropy(scores, targets, weights, reduction="sum")
    return torch.stack([entropy, weights.sum()])


@torch.no_grad()
def mean_square(
    network: FusionNetwork, rows: Rows, reduce: Callable[[Tensor], Tensor] = torch.clone
) -> Tensor:
    """Return the weighted mean of the squared errors.

    Args:
        network: Network to evaluate.
        rows: Rows of this process.
        reduce: Function that adds a tensor up over all processes.
    """
    sums = torch.stack([weighted_squares(network, part) for part in _parts(rows)]).sum(dim=0)
    square, weight = reduce(sums).unbind()
    return square / weight


@torch.no_grad()
def normal_equations(
    network: RescoringMlp, rows: Rows, reduce: Callable[[Tensor], Tensor] = torch.clone
) -> NormalEquations:
    """Return the same error with its derivatives; arguments as of `mean_square`."""
    weights = [layer.weight for layer in network.linear_layers]
    slopes = [one.new_zeros(len(one), one.shape[1] + 1) for one in weights]
    blocks = {
        (one, other): _Block(weights[one], weights[other])
        for one in range(len(weights))
        for other in range(one, len(weights))
    }
    sums = weights[0].new_zeros(2)
    for part in _parts(rows):
        residuals, factors = _factors(network, part)
        sums += torch.stack([residuals.square().sum(), part[2].sum()])
        for slope, factor in zip(slopes, factors, strict=True):
            slope.addmm_((factor.back * residuals[:, None]).sum(dim=0), factor.values.T)
        for (one, other), block in blocks.items():
            block.add(factors[one], factors[other])
    matrix = torch.cat(
        [
            torch.cat(
                [
                    blocks[one, other].matrix if one <= other else blocks[other, one].matrix.T
                    for other in range(len(weights))
                ],
                dim=1,
            )
            for one in range(len(weights))
        ]
    )
    order = _torch_order(weights)
    gradient = torch.cat([slope.flatten() for slope in slopes])[order]
    square, weight = reduce(sums).unbind()
    return NormalEquations(
        square / weight, reduce(gradient) / weight, reduce(matrix[order][:, order]) / weight
    )


def _factors(network: RescoringMlp, rows: Rows) -> tuple[Tensor, list[_LayerFactors]]:
    """Return the (outputs, R) residuals of R rows, and the factors of each layer."""
    features, targets, weights = rows
    *inputs, outputs = network.activations(features)
    roots = weights.sqrt()
    # An output changes with what enters it, and with no other's.
    back = roots.diag_embed().permute(1, 2, 0).contiguous()
    factors: list[_LayerFactors] = []
    for layer, entered in zip(reversed(network.linear_layers), reversed(inputs), strict=True):
        values = entered.T.contiguous()
        factors.insert(0, _LayerFactors(back, torch.cat([values, torch.ones_like(values[:1])])))
        # Through the layer, and through the tanh before it: 1 - tanh².
        back = (layer.weight.T @ back) * (1 - values.square())
    return ((outputs - targets) * roots).T, factors


def _torch_order(weights: Sequence[Tensor]) -> Tensor:
    """Return the places of torch's parameters, biases after weights, in layers of biases beside weights."""
    order, start = [], 0
    for one in weights:
        shape = len(one), one.shape[1] + 1
        places = start + torch.arange(shape[0] * shape[1], device=one.device).view(shape)
        order += [places[:, :-1].flatten(), places[:, -1]]
        start += places.numel()
    return torch.cat(order)


def _parts(rows: Rows) -> Iterator[tuple[Tensor, ...]]:
    """Yield rows by parts that bound the memory."""
    size = _CPU_ROWS if rows[0].device.type == "cpu" else _GPU_ROWS
    return zip(*(torch.split(column, size) for column in rows), strict=True)
