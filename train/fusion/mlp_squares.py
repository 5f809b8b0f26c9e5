"""The mean square error of a network of the fusion as a least-squares problem, with its exact Jacobian."""

import math

import numpy as np
import torch
from torch import Tensor
from torch.nn.utils import parameters_to_vector

from perception.types import Float64
from train.fusion.levenberg_marquardt import NormalEquations
from train.fusion.mlp import RescoringMlp
from train.fusion.targets import FusionRows

_ROWS_AT_ONCE = 1024  # which bounds the memory of the Jacobian


class MlpSquares:
    """Weighted squares of what a network says less its targets, over its P parameters as one vector.

    In double precision: the curvature has eigenvalues of many magnitudes.
    """

    def __init__(self, network: RescoringMlp, rows: FusionRows) -> None:
        """Take the network as a start, and the T rows that it shall fit."""
        self._form, self._state = network.form, network.state_dict()
        self._shapes = {name: weight.shape for name, weight in network.named_parameters()}
        self._bends_output = network.form.variant == "default"
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
        *_, says = self._layers(self._named(parameters), self._inputs)
        found: Float64 = ((says - self._targets) * self._roots).reshape(-1).numpy()
        return found

    def jacobian(self, parameters: Float64, rows: slice = slice(None)) -> Float64:
        """Return (3R, P) derivatives of the residuals of R rows."""
        weights = self._named(parameters)
        *inputs, says = self._layers(weights, self._inputs[rows])
        # (R, 3, 3): how each output goes with what comes into its bend, and with no other's.
        slopes = (says * (1 - says) if self._bends_output else torch.ones_like(says)).diag_embed()
        back = slopes * self._roots[rows, :, None]
        columns: list[Tensor] = []
        layers = self._layer_names()
        for name, values in zip(reversed(layers), reversed(inputs), strict=True):
            of_weights = back[:, :, :, None] * values[:, None, None, :]
            columns = [of_weights.flatten(2), back, *columns]
            # Through the layer, and through the tanh before it: 1 - tanh².
            back = (back @ weights[f"{name}.weight"]) * (1 - values**2)[:, None]
        found: Float64 = torch.cat(columns, dim=2).flatten(0, 1).numpy()
        return found

    def normal_equations(self, parameters: Float64) -> NormalEquations:
        """Return the error with its derivatives, summed up over parts of the rows."""
        count = len(parameters)
        gradient, curvature = np.zeros(count), np.zeros((count, count))
        residuals = self.residuals(parameters)
        for start in range(0, len(self._inputs), _ROWS_AT_ONCE):
            end = min(start + _ROWS_AT_ONCE, len(self._inputs))
            jacobian = self.jacobian(parameters, slice(start, end))
            gradient += jacobian.T @ residuals[3 * start : 3 * end]
            curvature += jacobian.T @ jacobian
        square = float(np.sum(residuals**2))
        return NormalEquations(
            square / self._total, gradient / self._total, curvature / self._total
        )

    def network_of(self, parameters: Float64) -> RescoringMlp:
        """Return a network with these parameters."""
        made = RescoringMlp(self._form)
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

    def _named(self, parameters: Float64) -> dict[str, Tensor]:
        sizes = [math.prod(shape) for shape in self._shapes.values()]
        parts = torch.split(torch.from_numpy(parameters), sizes)
        return {
            name: part.view(shape)
            for (name, shape), part in zip(self._shapes.items(), parts, strict=True)
        }
