"""Bodies of one world's traffic, from which each actor draws its own."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from data.synthetic import actors as actor_models
from data.synthetic.actors import Body
from data.synthetic.heavy_vehicles import HeavyKind
from data.synthetic.world_config import WorldConfig

_HEAVY_IN_YARDS = 0.07  # share of the vehicles in parking lots, where others are no more common
_TRAILERS_IN_YARDS = 0.4  # share of these that are semi-trailers


class Fleet:
    """Bodies of vehicles, pedestrians, cyclists and motorcyclists."""

    def __init__(self, config: WorldConfig, rng: np.random.Generator) -> None:
        """Draw the bodies of a world; kinds without a share draw no number."""
        self._config, self._rng = config, rng
        draw = (
            actor_models.draw_mixed_vehicles
            if config.is_mixed_fleet
            else actor_models.draw_vehicles
        )
        self._light = draw(rng, 11)
        self._heavy = actor_models.draw_heavy_vehicles(rng, 3) if config.heavy > 0 else []
        self._walkers = (
            actor_models.draw_figures(rng, 6)
            if config.is_mixed_crowd
            else actor_models.draw_pedestrians(rng, 3)
        )
        self._riders = actor_models.draw_cyclists(rng, 2)
        self._vans = actor_models.draw_vans(rng, 3) if config.vans > 0 else []
        self._light_trucks = (
            actor_models.draw_light_trucks(rng, 3) if config.light_trucks > 0 else []
        )
        self._trams = [actor_models.draw_heavy(HeavyKind.TRAM, rng)] if config.trams > 0 else []
        self._trailers = (
            [actor_models.draw_heavy(HeavyKind.SEMI_TRAILER, rng)] if config.heavy > 0 else []
        )
        self._towed = (
            [actor_models.draw_heavy(HeavyKind.TRAILER, rng) for _ in range(2)]
            if config.trailers > 0
            else []
        )
        self._towing = [replace(self._one(self._light), trailer=towed) for towed in self._towed]
        self._motorcyclists = (
            actor_models.draw_motorcyclists(rng, 3) if config.motorcyclists > 0 else []
        )

    def driving(self) -> Body:
        """Draw a vehicle that drives."""
        if self._is_one_of(self._trams, self._config.trams):
            return self._one(self._trams)
        if self._is_one_of(self._motorcyclists, self._config.motorcyclists):
            return self._one(self._motorcyclists)
        if self._is_one_of(self._towing, self._config.trailers):
            return self._one(self._towing)
        if not self._is_one_of(self._heavy, self._config.heavy):
            return self.light()
        body = self._one(self._heavy)
        return body if body.kind != "Misc" else self.light()

    def parked(self) -> Body:
        """Draw a vehicle of a parking lane: a car, a van or a small trailer without one."""
        if self._is_one_of(self._towed, self._config.trailers):
            return self._one(self._towed)
        return self.light()

    def light(self) -> Body:
        """Draw a car, a van or a light truck."""
        if self._is_one_of(self._light_trucks, self._config.light_trucks):
            return self._one(self._light_trucks)
        is_van = self._is_one_of(self._vans, self._config.vans)
        return self._one(self._vans if is_van else self._light)

    def off_road(self) -> Body:
        """Draw a vehicle of a parking lot."""
        if not self._is_one_of(self._heavy, max(_HEAVY_IN_YARDS, self._config.heavy)):
            return self.light()
        return self._one(self._trailers if self._rng.random() < _TRAILERS_IN_YARDS else self._heavy)

    def walker(self) -> Body:
        """Draw a pedestrian who walks."""
        return self._one(self._walkers)

    def waiting(self) -> Body:
        """Draw a pedestrian who stands."""
        if self._config.is_mixed_crowd:
            return actor_models.draw_standing_figure(self._rng)
        return actor_models.draw_standing_pedestrian(self._rng)

    def rider(self) -> Body:
        """Draw a cyclist."""
        return self._one(self._riders)

    def _is_one_of(self, bodies: Sequence[Body], share: float) -> bool:
        return bool(bodies) and bool(self._rng.random() < share)

    def _one(self, bodies: Sequence[Body]) -> Body:
        return bodies[int(self._rng.integers(len(bodies)))]
