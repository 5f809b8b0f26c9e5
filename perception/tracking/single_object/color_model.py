"""Which colours tell an object from what is around it, and how they change as the light does (5.3.3).

A colour is one of 8 x 8 x 8 bins of red, green and blue; a colour model gives each bin a ratio from 0,
as frequent around the object as on it, to 1, the colour that tells most.
"""

import numpy as np

from perception.tracking import kalman
from perception.tracking.kalman import Gaussians
from perception.tracking.single_object.fusion.image_region import ImageRegion
from perception.types import Float64, Int, UInt8

BINS_PER_CHANNEL = 8  # b of Table 7.5
BINS = BINS_PER_CHANNEL**3
_BITS_LOST = 5  # of the 8 of a channel

# Of the author's code: a scan every 0.1 s, and the noise of a bin's value and of its measurement.
_STEP_S = 0.1
_TRANSITION = np.array([[1, _STEP_S, _STEP_S**2 / 2], [0, 1, _STEP_S], [0, 0, 1]])
_PROCESS_NOISE = 0.1 * np.eye(3)
_MEASUREMENT_NOISE = np.eye(1)
_OBSERVE_VALUE = np.eye(1, 3)


def color_bins(image: UInt8) -> Int:
    """Return the bin of each (..., 3) RGB colour; red changes it most and blue least."""
    red, green, blue = np.moveaxis(image >> _BITS_LOST, -1, 0)
    # Green and blue together fit into the byte that they come in.
    return np.asarray(
        red.astype(np.int32) * BINS_PER_CHANNEL**2 + (green * np.uint8(BINS_PER_CHANNEL) + blue)
    )


def bin_colors() -> UInt8:
    """Return (512, 3) RGB of the middle of each bin."""
    levels = np.indices((BINS_PER_CHANNEL,) * 3).reshape(3, BINS).T
    return np.asarray((levels << _BITS_LOST) + (1 << _BITS_LOST - 1), np.uint8)


def color_ratios(image: UInt8, region: ImageRegion) -> Float64:
    """Return (512,) how much more likely each colour is on the object than around it (5.13), at most 1.

    All are 0 where the region has no pixel, or where no colour tells the object from its surroundings.
    """
    bins = color_bins(image[region.window])
    inside = np.bincount(bins[region.is_inside], minlength=BINS)
    ring = np.bincount(bins[region.is_ring], minlength=BINS)
    if not inside.any():
        return np.zeros(BINS)
    # Shares, not counts: where the image cuts the ring off, both areas differ. The ε of (5.13) is one
    # pixel; an object that fills the image has no ring, and its colours are then taken as they are.
    ring_area = ring.sum() or inside.sum()
    on_object = np.maximum(inside, 1) / inside.sum()
    around = np.maximum(ring, 1) / ring_area
    positive = np.where(inside > 0, np.maximum(np.log(on_object / around), 0), 0)
    return _scaled(positive)


class AdaptiveColorModel:
    """A colour model that follows the light: a bank of Kalman filters, one a bin that is in use.

    state     value  change per second  change of that per second    (constant acceleration)
    measured  value

    All filters take every step in one computation. A bin that is newly seen begins a filter; one that is
    not seen, or whose value is no longer positive, ends its filter.
    """

    def __init__(self) -> None:
        self._bins: Int = np.zeros(0, np.int64)
        self._states = Gaussians(np.zeros((0, 3)), np.zeros((0, 3, 3)))

    def __len__(self) -> int:
        """Return how many filters run."""
        return len(self._bins)

    @property
    def ratios(self) -> Float64:
        """(512,) filtered model, at most 1; all 0 where no filter runs."""
        values = np.zeros(BINS)
        values[self._bins] = self._states.mean[:, 0]
        return _scaled(values)

    def update(self, ratios: Float64) -> None:
        """Take in the (512,) colour model of one more image."""
        is_observed = ratios > 0
        goes_on = is_observed[self._bins]
        is_new = is_observed.copy()
        is_new[self._bins] = False
        old, new = self._bins[goes_on], np.flatnonzero(is_new)
        expected = kalman.predict(self._states[goes_on], _TRANSITION, _PROCESS_NOISE)
        corrected = kalman.update(expected, ratios[old, None], _OBSERVE_VALUE, _MEASUREMENT_NOISE)
        bins, states = np.concatenate([old, new]), corrected.joined(_init_filters(ratios[new]))
        is_kept = states.mean[:, 0] > 0
        self._bins, self._states = bins[is_kept], states[is_kept]


def _init_filters(values: Float64) -> Gaussians:
    """Return the states of bins that are seen for the first time, at rest."""
    mean = np.column_stack([values, np.zeros((len(values), 2))])
    return Gaussians(mean, np.tile(np.eye(3), (len(values), 1, 1)))


def _scaled(ratios: Float64) -> Float64:
    largest = ratios.max()
    return np.asarray(ratios / largest) if largest > 0 else np.zeros_like(ratios)
