"""Which end of a vehicle is its front, in log-odds: by its shape, by its motion, and by the traffic.

The cabin of a car lies behind its middle, and its hood is lower than its rear. Where that is not seen, vehicles are taken to
head as the traffic does on its side; how often this is so is learned from those whose shape or motion tells.
"""

from dataclasses import replace

import numpy as np

from perception.geometry.se3 import wrap
from perception.tracking.vehicles.evidence import log_odds, probability, remembered
from perception.types import Bool, Float, Float64, Int, Vehicles

_SHAPED = ("Car", "Van")  # classes whose shape tells; on synthetic streets that of others does not
# Share of the length from the middle, and of the height, beyond which ends and the cabin are.
_ENDS, _HIGH = 0.3, 0.7
_BODY = (0.55, 1.15)  # the same within which returns are of the body
_MIN_RETURNS = 3  # of each end, and of the cabin
# Log-odds by the difference of the heights of both ends, the mean place of high returns, and how far it is ahead of that of the
# low ones, as shares of height and length: logistic regression over boxes from above of 350 frames of synthetic streets, of six
# LiDARs of 16 to 64 beams.
_ODDS = np.array([-4.4, -8.3, -4.2])
_RANDOM_SHARE = 0.1  # of vehicles whose shape says nothing, as of boxes of another's returns
# Shares of vehicles that head as expected, and the number of vehicles that are taken to have done so before any is seen.
_SHARES, _EXPECTED = np.arange(0.025, 1, 0.05), 8.0
# Time constants of the memory of these, and of a vehicle that is one, not two.
_RECORD_S, _SAME_S = 60.0, 4.0


def shape_odds(vehicles: Vehicles, points_velo: Float) -> Float64:
    """Return (M,) log-odds that the stated front of each vehicle is its front, by its returns; 0 where these do not tell.

    Args:
        vehicles: M vehicles in the LiDAR frame.
        points_velo: (N, 3+) points of their scan.
    """
    boxes, count = vehicles.boxes, len(vehicles)
    is_shaped = np.isin(vehicles.fused.detections.types, _SHAPED) & np.isfinite(boxes.yaw_rad)
    rows = np.flatnonzero(np.append(is_shaped, False)[vehicles.owners])
    owners = vehicles.owners[rows]
    offsets_m = points_velo[rows, :3] - boxes.bottom_m[owners]
    ahead = np.column_stack([np.cos(boxes.yaw_rad), np.sin(boxes.yaw_rad)])[owners]
    along = (offsets_m[:, :2] * ahead).sum(axis=1) / boxes.size_m[owners, 0]
    heights = offsets_m[:, 2] / boxes.size_m[owners, 2]
    is_body = (np.abs(along) <= _BODY[0]) & (heights <= _BODY[1])
    owners, along, heights = owners[is_body], along[is_body], heights[is_body]
    is_high = heights > _HIGH
    high, low = (_means(owners[one], along[one], count) for one in (is_high, ~is_high))
    tops = np.zeros((2, count))
    returns = np.zeros((2, count), np.int64)
    for top, number, is_end in zip(tops, returns, (along > _ENDS, along < -_ENDS), strict=True):
        np.maximum.at(top, owners[is_end], heights[is_end])
        np.add.at(number, owners[is_end], 1)
    ends = np.where(returns.min(axis=0) >= _MIN_RETURNS, tops[0] - tops[1], 0.0)
    cues = np.column_stack([ends, np.nan_to_num(high), np.nan_to_num(high - low)])
    odds = cues @ _ODDS
    return log_odds((1 - _RANDOM_SHARE) * probability(odds) + _RANDOM_SHARE / 2)


def _means(owners: Int, along: Float64, count: int) -> Float64:
    """Return (M,) means of the places of returns, by their (N,) vehicles; NaN of too few."""
    returns = np.bincount(owners, minlength=count)
    means = np.bincount(owners, along, count) / np.maximum(returns, 1)
    return np.where(returns >= _MIN_RETURNS, means, np.nan)


class FrontRecord:
    """How often vehicles head as expected by the traffic, as far as their shape and motion tell: Bayes over shares of them."""

    def __init__(self) -> None:
        self._evidence = np.zeros(len(_SHARES))

    @property
    def reliability(self) -> float:
        """Probability that a vehicle heads as expected."""
        posterior = _SHARES**_EXPECTED * np.exp(self._evidence - self._evidence.max())
        return float(posterior @ _SHARES / posterior.sum())

    def odds(self, vehicles: Vehicles, by_shape: Float64) -> Float64:
        """Return (M,) log-odds that the stated front of each untracked vehicle is its front, by shape and traffic."""
        reversal = vehicles.box_deviations.reversal
        expected = self.reliability * (1 - reversal) + (1 - self.reliability) * reversal
        return np.nan_to_num(log_odds(expected) + by_shape)

    def update(self, odds: Float64, is_new: Bool, elapsed_s: float) -> None:
        """Add V vehicles.

        Args:
            odds: (V,) log-odds that each heads as expected, by its shape and motion.
            is_new: (V,) whether it was not seen before.
            elapsed_s: Time since the frame before.
        """
        weights = np.where(is_new, 1.0, 1 - remembered(elapsed_s, _SAME_S))
        agrees = probability(odds)[:, None]
        likelihoods = _SHARES * agrees + (1 - _SHARES) * (1 - agrees)
        self._evidence *= remembered(elapsed_s, _RECORD_S)
        self._evidence += weights @ np.log(likelihoods)


def with_fronts(vehicles: Vehicles, odds: Float64) -> Vehicles:
    """Return vehicles whose stated front is the likelier end, by (M,) log-odds that it is the stated one."""
    yaw_rad = wrap(vehicles.boxes.yaw_rad + np.where(odds < 0, np.pi, 0.0))
    reversal = np.where(np.isfinite(yaw_rad), probability(-np.abs(odds)), np.nan)
    return replace(
        vehicles,
        boxes=replace(vehicles.boxes, yaw_rad=yaw_rad),
        box_deviations=replace(vehicles.box_deviations, reversal=reversal),
    )
