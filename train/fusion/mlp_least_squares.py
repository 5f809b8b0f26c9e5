"""The mean square error of a network of the fusion as a least-squares problem, with its exact derivatives."""

import math

import numpy as np
import torch
from torch import Tensor
from torch.nn.utils import parameters_to_vector

from perception.types import Float64
from train.fusion.gauss_newton import GaussNewtonSums, LayerFactors
from train.fusion.levenberg_marquardt import NormalEquations
from train.fusion.mlp import RescoringMlp
from train.fusion.targets import FusionRows

_ROWS_AT_ONCE = 512  # so that intermediate results stay in the processor's cache


class MlpLeastSquares:
    """Weighted squared errors of a network, over its P parameters as one vector.

    In double precision: the curvature has eigenvalues of many magnitudes.
    """

    def __init__(self, network: RescoringMlp, rows: FusionRows) -> None:
        """Take the network as a start, and the T rows that it shall fit."""
        self._config, self._state = network.config, network.state_dict()
        self._shapes = {name: weight.shape for name, weight in network.named_parameters()}
        self._bends_output = network.config.variant == "default"
        self.start: Float64 = parameters_to_vector(network.parameters()).detach().double().numpy()
        """(P,) the parameters of the network."""
        features = torch.from_numpy(rows.features)
        self._inputs = network.mapped(features).double()
        self._targets = torch.from_numpy(rows.targets).double()
        self._roots = torch.from_numpy(rows.weights).double().sqrt()
        self._total = float(rows.weights.sum())

    def mean_square(self, parameters: Float64) -> float:
        """Return the weighted mean of the squared errors."""
        return float(np.sum(self.residuals(parameters) ** 2)) / self._total

    def residuals(self, parameters: Float64) -> Float64:
        """Return (3T,) the errors times the roots of their weights."""
        found: Float64 = self.residuals_of(torch.from_numpy(parameters)).numpy()
        return found

    def residuals_of(self, parameters: Tensor) -> Tensor:
        """Return the residuals of a tensor, for derivatives by torch."""
        *_, says = self._layers(self._named(parameters), self._inputs)
        return ((says - self._targets) * self._roots).reshape(-1)

    def normal_equations(self, parameters: Float64) -> NormalEquations:
        """Return the error with its derivatives, summed up over parts of the rows, without the Jacobian."""
        sums = GaussNewtonSums([self._shapes[f"{name}.weight"] for name in self._layer_names()])
        weights, square = self._named(parameters), 0.0
        for start in range(0, len(self._inputs), _ROWS_AT_ONCE):
            rows = slice(start, start + _ROWS_AT_ONCE)
            *inputs, says = self._layers(weights, self._inputs[rows])
            residuals = ((says - self._targets[rows]) * self._roots[rows]).T
            square += float((residuals**2).sum())
            sums.add(residuals, self._factors(weights, inputs, says, self._roots[rows]))
        return NormalEquations(
            square / self._total, sums.gradient / self._total, sums.normal_matrix / self._total
        )

    def _factors(
        self, weights: dict[str, Tensor], inputs: list[Tensor], says: Tensor, roots: Tensor
    ) -> list[LayerFactors]:
        """Return the factors of R rows for each layer, from the inputs of each."""
        slopes = says * (1 - says) if self._bends_output else torch.ones_like(says)
        # How each output goes with what comes into its bend, and with no other's.
        back = (slopes * roots).diag_embed().permute(1, 2, 0).contiguous()
        factors: list[LayerFactors] = []
        for name, entered in zip(reversed(self._layer_names()), reversed(inputs), strict=True):
            values = entered.T.contiguous()
            factors.insert(0, LayerFactors(back, torch.cat([values, torch.ones_like(values[:1])])))
            # Through the layer, and through the tanh before it: 1 - tanh².
            back = (weights[f"{name}.weight"].T @ back) * (1 - values**2)
        return factors

    def network_of(self, parameters: Float64) -> RescoringMlp:
        """Return a network with these parameters."""
        made = RescoringMlp(self._config)
        made.load_state_dict(self._state | self._named(parameters))
        return made

    def _layers(self, weights: dict[str, Tensor], inputs: Tensor) -> list[Tensor]:
        """Return what goes into each layer, and what comes out of the last."""
        values = [inputs]
        *hidden, last = self._layer_names()
        for name in hidden:
            bent = torch.tanh(values[-1] @ weights[f"{name}.weight"].T + weights[f"{name}.bias"])
            values.append(bent)
        raw = values[-1] @ weights[f"{last}.weight"].T + weights[f"{last}.bias"]
        return [*values, torch.sigmoid(raw) if self._bends_output else raw]

    def _layer_names(self) -> list[str]:
        return [name.removesuffix(".weight") for name in self._shapes if name.endswith(".weight")]

    def _named(self, parameters: Float64 | Tensor) -> dict[str, Tensor]:
        sizes = [math.prod(shape) for shape in self._shapes.values()]
        parts = torch.split(torch.as_tensor(parameters), sizes)
        return {
            name: part.view(shape)
            for (name, shape), part in zip(self._shapes.items(), parts, strict=True)
        }
