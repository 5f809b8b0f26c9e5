"""What a laser brings back: weaker with range, from laser to laser, at a slant, too near."""

import numpy as np
import pytest

from data.synthetic.echoes import EchoModel, Shots
from data.synthetic.materials import Slot
from perception.sensor import HDL_64E

SHOTS = HDL_64E.beams * HDL_64E.columns
MODEL = EchoModel()


def shots(distance_m: float, albedo: float = 0.4, cosine: float = 1.0) -> Shots:
    return Shots(*(np.full(SHOTS, value, np.float32) for value in (albedo, cosine, distance_m)))


def reported(slot: Slot, fired: Shots, unit: int = 0) -> np.ndarray:
    slots = np.full(SHOTS, slot)
    return MODEL.reflectance(HDL_64E, slots, fired, unit, np.random.default_rng(0))


def test_reflectance_is_even_over_the_range_until_full_power_and_then_falls_to_zero():
    median = [np.median(reported(Slot.WALL, shots(distance))) for distance in (12, 28, 45, 90)]
    assert median[0] == pytest.approx(0.4, abs=0.05)
    assert median[1] == pytest.approx(median[0], abs=0.02)
    assert 0.1 < median[2] < 0.7 * median[0]
    assert median[3] == 0


def test_a_slanting_surface_weakens_sooner():
    road, wall = (
        np.mean(reported(Slot.ASPHALT, shots(32.0, cosine=cosine)) == 0) for cosine in (0.05, 1.0)
    )
    assert road > 0.4
    assert wall < 0.1


def test_black_paint_reads_zero_and_loses_slanting_shots():
    black = shots(12.0, albedo=0.05, cosine=0.4)
    assert np.median(reported(Slot.PAINT, black)) == 0
    slots = np.full(SHOTS, Slot.PAINT)
    silver = shots(12.0, albedo=0.45, cosine=0.4)
    kept = [MODEL.kept_share(HDL_64E, slots, fired).mean() for fired in (black, silver)]
    assert kept[0] < 0.8
    assert kept[1] > 0.95


def test_paint_is_lost_sooner_than_walls_the_darker_the_sooner():
    far = [shots(40.0, albedo=albedo) for albedo in (0.09, 0.45)]
    paint, wall = (
        [MODEL.kept_share(HDL_64E, np.full(SHOTS, slot), fired).mean() for fired in far]
        for slot in (Slot.PAINT, Slot.WALL)
    )
    assert paint[0] < 0.75
    assert paint[1] > 0.9
    assert min(wall) > 0.95


def test_a_weak_sensor_loses_black_vehicles_at_any_range_but_no_road_and_no_white_paint():
    def kept(slot: Slot, albedo: float, cosine: float = 0.5) -> float:
        fired = shots(6.0, albedo, cosine)
        usual, weak = (
            MODEL.kept_share(HDL_64E, np.full(SHOTS, slot), fired, share) for share in (0.0, 0.6)
        )
        return float((weak / usual).mean())

    assert kept(Slot.SHIRT, 0.1) == pytest.approx(0.4, abs=0.01)
    assert kept(Slot.PAINT, 0.6) == pytest.approx(1.0)
    assert kept(Slot.PAINT, 0.3, cosine=0.1) == pytest.approx(1 - 0.6 * 0.6 * 1.4, abs=0.01)
    assert kept(Slot.ASPHALT, 0.1) == pytest.approx(1.0)


def test_a_sign_far_away_is_bright():
    assert np.median(reported(Slot.SIGN, shots(55.0, albedo=0.9))) > 0.8


def test_lasers_of_one_unit_differ_and_stay_as_they_are():
    gains = MODEL.gains(HDL_64E, 1)
    assert np.array_equal(gains, MODEL.gains(HDL_64E, 1))
    assert not np.array_equal(gains, MODEL.gains(HDL_64E, 2))
    assert np.std(np.log(gains)) > 0.15
    by_laser = np.median(reported(Slot.WALL, shots(12.0), unit=1).reshape(-1, HDL_64E.beams), 0)
    assert by_laser == pytest.approx(np.where(0.4 * gains < 0.1, 0, 0.4 * gains), abs=0.03)


def test_the_highest_lasers_are_out_of_focus_nearby():
    near = reported(Slot.WALL, shots(3.0)).reshape(-1, HDL_64E.beams)
    assert near[:, :20].mean() < 0.5 * near[:, -10:].mean()
