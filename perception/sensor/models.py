"""LiDARs that people have, by the data sheets and user manuals of their makers.

Values are of 10 revolutions or scans a second. Heights are those of KITTI's car (thesis 3.1.1): a file for --sensor that
names a model changes what differs. Units leave the line with calibrated elevations, up to 2 degrees from these.

Elevations that were compared, one by one, with a table of the maker name it. The others are even fans, or tables that no
manual at hand has confirmed: the field of view and the number of beams are the maker's, single angles may be off.
"""

from collections.abc import Sequence

import numpy as np

from perception.sensor.beam_tables import (
    PANDAR_64_DEG,
    QT_64_DEG,
    VLP_32C_BY_LASER_DEG,
    VLS_128_BY_LASER_DEG,
)
from perception.types import Float64, LidarModel

_HEIGHT_M = 1.73
_SCANS_PER_S = 10.0


def _fan(top_deg: float, bottom_deg: float, beams: int) -> Float64:
    return np.linspace(top_deg, bottom_deg, beams)


def _spinning(
    name: str,
    elevations_deg: Float64 | Sequence[float],
    azimuth_step_deg: float,
    ranges_m: tuple[float, float],
    noise_m: float = 0.02,
    field_of_view_deg: float = 360.0,
) -> LidarModel:
    return LidarModel(
        name=name,
        elevations_rad=np.radians(np.sort(np.asarray(elevations_deg, np.float64))[::-1]),
        azimuth_step_rad=float(np.radians(azimuth_step_deg)),
        rate_hz=_SCANS_PER_S,
        height_m=_HEIGHT_M,
        min_range_m=ranges_m[0],
        max_range_m=ranges_m[1],
        range_noise_m=noise_m,
        field_of_view_rad=float(np.radians(field_of_view_deg)),
    )


def _by_angle(
    name: str,
    view_deg: tuple[float, float, float],
    points_per_s: float,
    ranges_m: tuple[float, float],
) -> LidarModel:
    """Return a LiDAR without rings, of rows and columns as far apart as the returns of one scan are on average.

    Args:
        name: Name given by its maker.
        view_deg: Horizontal field of view, highest and lowest elevation.
        points_per_s: Returns per second.
        ranges_m: Nearest and farthest range.
    """
    width_deg, top_deg, bottom_deg = view_deg
    step_deg = np.sqrt(width_deg * (top_deg - bottom_deg) * _SCANS_PER_S / points_per_s)
    rows = round((top_deg - bottom_deg) / step_deg) + 1
    return LidarModel(
        name=name,
        elevations_rad=np.radians(_fan(top_deg, bottom_deg, rows)),
        azimuth_step_rad=float(np.radians(step_deg)),
        rate_hz=_SCANS_PER_S,
        height_m=_HEIGHT_M,
        min_range_m=ranges_m[0],
        max_range_m=ranges_m[1],
        range_noise_m=0.02,
        field_of_view_rad=float(np.radians(width_deg)),
        has_rings=False,
    )


# Not compared with a table: two even blocks of 32 beams.
HDL_64E = _spinning(
    "HDL-64E", [*_fan(2.0, -8.33, 32), *_fan(-8.83, -24.33, 32)], 0.1728, (0.9, 120.0)
)
# Compared with the HDL-32E user's manual, "Laser Firing Sequence": 10.67 to -30.67, 4/3 apart; no return beyond 100 m.
HDL_32E = _spinning("HDL-32E", _fan(10.67, -30.67, 32), 0.1660, (1.0, 100.0))
# Compared in part with the VLP-16 user manual, table 9-1, vertical angle by laser ID: lasers 7 to 15.
VLP_16 = _spinning("VLP-16", _fan(15.0, -15.0, 16), 0.2, (0.5, 100.0))
# Compared with user manual 63-9325 revision C, table 9-6: 0.333 degrees apart around the horizon.
VLP_32C = _spinning("VLP-32C", VLP_32C_BY_LASER_DEG, 0.2, (1.0, 200.0))
# Compared with the tables of two drivers, all 128: 0.11 degrees apart around the horizon.
VLS_128 = _spinning("VLS-128", VLS_128_BY_LASER_DEG, 0.2, (0.5, 220.0))

# Not compared with a table: beams even over the field of view, 1024 columns a turn. The first data sheet of the OS1
# states 45 degrees for 128 beams, as here, and 33.2 for 64 and 16: `elevations_deg` of a file describes such a unit. Every
# Ouster states its own beam angles in its metadata.
_OUSTER = tuple(
    _spinning(f"{family}-{beams}", _fan(half_deg, -half_deg, beams), 360 / 1024, ranges_m)
    for family, half_deg, ranges_m in (
        ("OS0", 45.0, (0.3, 50.0)),
        ("OS1", 22.5, (0.3, 120.0)),
        ("OS2", 11.25, (0.8, 240.0)),
    )
    for beams in (32, 64, 128)
)

# Pandar40P, Pandar64 and QT64: compared with the tables of the maker's drivers.
# Pandar40P and Pandar64 are densest from 2 to -6 degrees.
_PANDAR_SIDES = (*_fan(-7.0, -14.0, 8), -19.0, -25.0)
_HESAI = (
    _spinning(
        "Pandar40P", [15, 11, 8, 5, 3, *_fan(2.0, -6.0, 25), *_PANDAR_SIDES], 0.2, (0.3, 200.0)
    ),
    _spinning("Pandar64", PANDAR_64_DEG, 0.2, (0.3, 200.0)),
    _spinning("QT64", QT_64_DEG, 0.6, (0.1, 60.0)),
    # Compared in part with the PandarXT user's manual, section 1.3: one degree apart; not the single angles.
    _spinning("XT32", _fan(15.0, -16.0, 32), 0.18, (0.05, 120.0), noise_m=0.01),
    # Not compared with a table.
    _spinning("AT128", _fan(12.9, -12.5, 128), 0.1, (1.0, 210.0), field_of_view_deg=120.0),
)

# Not compared with the specifications; their beams draw rosettes that fill the field of view within seconds.
_LIVOX = (
    _by_angle("Avia", (70.4, 38.6, -38.6), 240_000, (1.0, 190.0)),
    _by_angle("Horizon", (81.7, 12.55, -12.55), 240_000, (0.5, 90.0)),
    _by_angle("Mid-360", (360.0, 52.0, -7.0), 200_000, (0.1, 40.0)),
)

SENSORS = {
    sensor.name: sensor
    for sensor in (HDL_64E, HDL_32E, VLP_16, VLP_32C, VLS_128, *_OUSTER, *_HESAI, *_LIVOX)
}
