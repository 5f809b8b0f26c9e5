"""Lidar returns: whether a shot has a return, and the reflectance that is reported.

    echo      = albedo x angle x gain of the laser x focus x weakening beyond full power x speckle
    reported  = echo, or 0 where it is weaker than the receiver's first step

A scan of KITTI reports a reflectance evened over the range as far as the sensor can raise its power, some
30 m of an HDL-64E's 120; beyond that the echo of the same surface weakens, and more and more of the points
read 0 although their range is right. So do dark paint and glass at any range.
"""

from dataclasses import dataclass

import numpy as np

from data.synthetic.materials import Slot, column
from perception.sensor import LidarModel
from perception.types import Bool, Float32

_IS_GLOSSY = np.isin(
    np.arange(len(Slot)),
    [Slot.PAINT, Slot.GLASS, Slot.WINDOW, Slot.RIM, Slot.HEADLIGHT, Slot.TAILLIGHT],
)
_ABSORBS = _IS_GLOSSY | np.isin(
    np.arange(len(Slot)),
    [Slot.TRIM, Slot.TYRE, Slot.INTERIOR, Slot.CARGO, Slot.BICYCLE,
     Slot.SKIN, Slot.HAIR, Slot.SHIRT, Slot.TROUSERS, Slot.SHOES],
)  # fmt: skip
_BLACK, _WHITE = (
    0.1,
    0.6,
)  # reflectance up to which a weak sensor loses most, and from which it loses nothing
_RETRO = (Slot.SIGN, Slot.PLATE, Slot.TAILLIGHT)


@dataclass(frozen=True)
class EchoModel:
    """Model of lidar returns; shares are of 1, spreads are standard deviations of the logarithm.

    Attributes:
        lost_signal: Reflectance over the squared share of the range at which half of all shots is lost.
        lost_glossy: Value of `lost_signal` for paint and panes, whose coat scatters little back.
        full_power: Share of the sensor's range up to which it evens out the echo of a surface face on; of
            a slanting one it falls short sooner.
        min_echo: Weakest echo that is reported; weaker ones are reported as 0.
        grazing: Strength of an echo from a surface seen edge on, over that face on.
        glossy_grazing: Value of `grazing` for glossy paint and panes.
        mirror: Share of the shots that black gloss turns away when seen edge on.
        speckle: Spread from shot to shot.
        gain: Spread from laser to laser of one sensor, which shows as rings on the road.
        weak: Share of lasers that are much weaker than the others.
        weak_gain: Gain of the weak lasers.
        near_focus: Share of the distance to where a laser meets level ground at which its echo is at full
            strength; nearer things are out of the receiver's focus.
        farthest_focus_m: Greatest distance from which an echo is at full strength, in metres.
        retro: Echo of a retroreflector over that of white paint.
    """

    lost_signal: float = 0.035
    lost_glossy: float = 0.5
    full_power: float = 0.25
    min_echo: float = 0.10
    grazing: float = 0.45
    glossy_grazing: float = 0.2
    mirror: float = 0.6
    speckle: float = 0.2
    gain: float = 0.2
    weak: float = 0.12
    weak_gain: float = 0.45
    near_focus: float = 0.6
    farthest_focus_m: float = 8.0
    retro: float = 12.0

    def gains(self, sensor: LidarModel, unit: int) -> Float32:
        """Return (L,) the gains of the lasers of one unit of a sensor."""
        rng = np.random.default_rng([sensor.beams, unit])
        gains = np.exp(self.gain * rng.standard_normal(sensor.beams))
        is_weak = rng.random(sensor.beams) < self.weak
        return np.where(is_weak, self.weak_gain, gains).astype(np.float32)

    def kept_share(
        self, sensor: LidarModel, slots: np.ndarray, shots: "Shots", absorption: float = 0.0
    ) -> Float32:
        """Return the probability that a shot has a return.

        Args:
            sensor: LiDAR model.
            slots: (N,) material at the end of each shot.
            shots: Shots where they end.
            absorption: Share of the shots on black surfaces of vehicles and people at 60 degrees that a
                weak sensor loses beside the others, at any range.
        """
        signal = shots.albedo * shots.cosine / (shots.distance_m / sensor.max_range_m) ** 2
        # Half of the returns is lost at the limit, nearly none at thrice and nearly all at a third of it.
        lost = np.where(_IS_GLOSSY, self.lost_glossy, self.lost_signal).astype(np.float32)[slots]
        share = (1 - column("drop")[slots]) / (1 + (lost / np.maximum(signal, 1e-6)) ** 2)
        # Dark glossy paint mirrors slanting shots away instead of scattering them back.
        turned = self.mirror * np.clip(1 - shots.albedo / 0.15, 0, 1) * (1 - shots.cosine)
        share -= _IS_GLOSSY[slots] * turned
        if absorption > 0:
            # On real scans of an HDL-32E, cars lose a third of their sheet metal, and two thirds of panes and roof.
            darkness = np.clip((_WHITE - shots.albedo) / (_WHITE - _BLACK), 0, 1)
            absorbed = np.minimum(absorption * darkness * (1.5 - shots.cosine), 0.95)
            share *= np.where(_ABSORBS[slots], 1 - absorbed, 1)
        return np.asarray(share, np.float32)

    def reflectance(
        self,
        sensor: LidarModel,
        slots: np.ndarray,
        shots: "Shots",
        unit: int,
        rng: np.random.Generator,
    ) -> Float32:
        """Return the reported reflectance of each return, in steps of 0.01."""
        edge_on = np.where(_IS_GLOSSY, self.glossy_grazing, self.grazing).astype(np.float32)
        grazing = edge_on[slots]
        angle = grazing + (1 - grazing) * shots.cosine
        full_m = self.full_power * sensor.max_range_m
        weakening = np.minimum(1, angle * (full_m / np.maximum(shots.distance_m, 1.0)) ** 2)
        gain = np.exp(self.speckle * rng.standard_normal(len(slots), np.float32))
        gain *= weakening * np.tile(self.gains(sensor, unit), sensor.columns)
        gain *= np.minimum(1, shots.distance_m / np.tile(self._focus_m(sensor), sensor.columns))
        echo = shots.albedo * angle * gain
        # A retroreflector's echo fills the receiver, whatever its angle, until it is far away.
        bright = np.minimum(shots.albedo, shots.albedo * self.retro * gain)
        echo = np.where(np.isin(slots, _RETRO), bright, echo)
        reported = np.where(echo < self.min_echo, 0, np.minimum(echo, 0.99))
        return np.round(reported, 2).astype(np.float32)

    def _focus_m(self, sensor: LidarModel) -> Float32:
        """Return (L,) the range from which each laser's echo is at full strength."""
        down = np.maximum(np.sin(-sensor.elevations_rad), 1e-3)
        focus_m = self.near_focus * sensor.height_m / down
        return np.minimum(focus_m, self.farthest_focus_m).astype(np.float32)


@dataclass(frozen=True)
class Shots:
    """N shots where they end.

    Attributes:
        albedo: (N,) reflectance of the surface face on.
        cosine: (N,) cosine of the angle between the ray and the surface's normal.
        distance_m: (N,) distance along the ray in metres; infinity where it meets nothing.
    """

    albedo: Float32
    cosine: Float32
    distance_m: Float32

    def within(self, sensor: LidarModel) -> Bool:
        """Return which shots end where the sensor can measure."""
        return np.asarray(
            (self.distance_m > sensor.min_range_m) & (self.distance_m < sensor.max_range_m)
        )
