"""Colour model of an object against its surroundings, and its adaptation to the light (5.3.3).

A colour is one of b x b x b bins of red, green and blue (b = 8, Table 7.5). A colour model gives each bin a ratio
from 0, as frequent around the object as on it, to 1, the most distinctive colour.
"""

import math

import numpy as np

from perception.tracking import kalman
from perception.tracking.kalman import Gaussians
from perception.tracking.single_object.config import ColorModelConfig
from perception.tracking.single_object.image_region import ImageRegion
from perception.types import Float64, Int, UInt8

# One update a scan, every 0.1 s.
_STEP_S = 0.1
_TRANSITION = np.array([[1, _STEP_S, _STEP_S**2 / 2], [0, 1, _STEP_S], [0, 0, 1]])
_OBSERVATION = np.eye(1, 3)


def color_bins(image: UInt8, bins_per_channel: int = ColorModelConfig.bins_per_channel) -> Int:
    """Return the bin of each (..., 3) RGB colour; red changes it most and blue least."""
    red, green, blue = np.moveaxis(image >> _dropped_bits(bins_per_channel), -1, 0)
    # Green and blue together fit into the byte that they come in.
    return np.asarray(
        red.astype(np.int32) * bins_per_channel**2 + (green * np.uint8(bins_per_channel) + blue)
    )


def bin_colors(bins_per_channel: int = ColorModelConfig.bins_per_channel) -> UInt8:
    """Return (b³, 3) the RGB colour in the middle of each bin."""
    dropped = _dropped_bits(bins_per_channel)
    levels = np.indices((bins_per_channel,) * 3).reshape(3, -1).T
    return np.asarray((levels << dropped) + (1 << dropped - 1), np.uint8)


def bins_per_channel_of(ratios: Float64) -> int:
    """Return b of a colour model with (b³,) ratios."""
    return round(math.cbrt(len(ratios)))


def color_ratios(
    image: UInt8, region: ImageRegion, bins_per_channel: int = ColorModelConfig.bins_per_channel
) -> Float64:
    """Return (b³,) how much more likely each colour is on the object than around it (5.13), at most 1.

    All are 0 where the region has no pixel, or where no colour distinguishes the object from its surroundings.
    """
    count = bins_per_channel**3
    bins = color_bins(image[region.window], bins_per_channel)
    inside = np.bincount(bins[region.is_inside], minlength=count)
    ring = np.bincount(bins[region.is_ring], minlength=count)
    if not inside.any():
        return np.zeros(count)
    # Shares, not counts: where the image cuts the ring off, both areas differ. The ε of (5.13) is one
    # pixel; an object that fills the image has no ring, and its colours are taken as they are.
    ring_area = ring.sum() or inside.sum()
    on_object = np.maximum(inside, 1) / inside.sum()
    around = np.maximum(ring, 1) / ring_area
    positive = np.where(inside > 0, np.maximum(np.log(on_object / around), 0), 0)
    return _scaled(positive)


class AdaptiveColorModel:
    """Colour model that adapts to the light: a Kalman filter for each bin in use.

    state     value  change per second  change of that per second    (constant acceleration)
    measured  value

    All filters take a step in one computation. A bin that is observed for the first time starts a filter; a bin
    that is not observed, or whose value is no longer positive, deletes its filter.
    """

    def __init__(self, config: ColorModelConfig | None = None) -> None:
        config = config or ColorModelConfig()
        self._count = config.bins
        self._process_noise = config.noise.process * np.eye(3)
        self._measurement_noise = config.noise.measurement * np.eye(1)
        self._initial = config.noise.initial * np.eye(3)
        self._bins: Int = np.zeros(0, np.int64)
        self._states = Gaussians(np.zeros((0, 3)), np.zeros((0, 3, 3)))

    def __len__(self) -> int:
        """Return the number of filters."""
        return len(self._bins)

    @property
    def ratios(self) -> Float64:
        """(b³,) filtered model, at most 1; all 0 without a filter."""
        values = np.zeros(self._count)
        values[self._bins] = self._states.mean[:, 0]
        return _scaled(values)

    def update(self, ratios: Float64) -> None:
        """Correct the model by the (b³,) ratios of one more image."""
        is_observed = ratios > 0
        is_kept = is_observed[self._bins]
        is_new = is_observed.copy()
        is_new[self._bins] = False
        old, new = self._bins[is_kept], np.flatnonzero(is_new)
        predicted = kalman.predict(self._states[is_kept], _TRANSITION, self._process_noise)
        corrected = kalman.update(
            predicted, ratios[old, None], _OBSERVATION, self._measurement_noise
        )
        bins = np.concatenate([old, new])
        states = corrected.joined(self._initial_states(ratios[new]))
        is_positive = states.mean[:, 0] > 0
        self._bins, self._states = bins[is_positive], states[is_positive]

    def _initial_states(self, values: Float64) -> Gaussians:
        """Return the states of bins that are observed for the first time, at rest."""
        mean = np.column_stack([values, np.zeros((len(values), 2))])
        return Gaussians(mean, np.tile(self._initial, (len(values), 1, 1)))


def _dropped_bits(bins_per_channel: int) -> int:
    """Return how many of the 8 bits of a channel a bin spans."""
    return 9 - bins_per_channel.bit_length()


def _scaled(ratios: Float64) -> Float64:
    largest = ratios.max()
    return np.asarray(ratios / largest) if largest > 0 else np.zeros_like(ratios)
