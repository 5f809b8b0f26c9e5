"""LiDARs that people have, by the data sheets and user manuals of their makers.

Values are of 10 revolutions or scans a second. Heights are those of KITTI's car (thesis 3.1.1): a file for --sensor that
names a model changes what differs. Units leave the line with calibrated elevations, up to 2 degrees from these.

Elevations that were compared, one by one, with a table of the maker name it. The others are even fans, or tables that no
manual at hand has confirmed: the field of view and the number of beams are the maker's, single angles may be off.
"""

from collections.abc import Sequence

import numpy as np

from perception.sensor.model import LidarModel
from perception.types import Float64

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
VLP_32C = _spinning(
    "VLP-32C",
    [
        15.0, 10.333, 7.0, 4.667, 3.333, 2.333, 1.667, 1.333, 1.0, 0.667, 0.333, 0.0, -0.333, -0.667, -1.0, -1.333,
        -1.667, -2.0, -2.333, -2.667, -3.0, -3.333, -3.667, -4.0, -4.667, -5.333, -6.148, -7.254, -8.843, -11.31,
        -15.639, -25.0,
    ],
    0.2,
    (1.0, 200.0),
)  # fmt: skip
# Not compared with a table: 0.11 degrees apart around the horizon.
VLS_128 = _spinning(
    "VLS-128",
    [
        15.0, 11.75, 9.7, 8.43, 7.58, 6.98, 6.48, 6.08, 5.73, 5.43, 5.18, 4.98, 4.83, 4.72, 4.61, 4.5,
        4.39, 4.28, 4.17, 4.06, 3.95, 3.84, 3.73, 3.62, 3.51, 3.4, 3.29, 3.18, 3.07, 2.96, 2.85, 2.74,
        2.63, 2.52, 2.41, 2.3, 2.19, 2.08, 1.97, 1.86, 1.75, 1.64, 1.53, 1.42, 1.31, 1.2, 1.09, 0.98,
        0.87, 0.76, 0.65, 0.54, 0.43, 0.32, 0.21, 0.1, -0.01, -0.12, -0.23, -0.34, -0.45, -0.56, -0.67, -0.78,
        -0.89, -1.0, -1.11, -1.22, -1.33, -1.44, -1.55, -1.66, -1.77, -1.88, -1.99, -2.1, -2.21, -2.32, -2.43, -2.54,
        -2.65, -2.76, -2.87, -2.98, -3.09, -3.2, -3.31, -3.42, -3.53, -3.64, -3.75, -3.86, -3.97, -4.08, -4.19, -4.3,
        -4.41, -4.52, -4.63, -4.74, -4.85, -4.96, -5.07, -5.18, -5.29, -5.4, -5.51, -5.62, -5.73, -5.84, -5.95, -6.06,
        -6.17, -6.28, -6.39, -6.5, -6.65, -6.85, -7.15, -7.65, -8.352, -9.244, -10.346, -11.742, -13.565, -16.042,
        -19.582, -25.0,
    ],
    0.2,
    (0.5, 220.0),
)  # fmt: skip

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

# Not compared with a table, but in part for the XT32. Pandar40P and Pandar64 are densest from 2 to -6 degrees.
_PANDAR_SIDES = (*_fan(-7.0, -14.0, 8), -19.0, -25.0)
_HESAI = (
    _spinning(
        "Pandar40P", [15, 11, 8, 5, 3, *_fan(2.0, -6.0, 25), *_PANDAR_SIDES], 0.2, (0.3, 200.0)
    ),
    _spinning(
        "Pandar64", [15, 11, 8, 5, 3, *_fan(2.0, -6.0, 49), *_PANDAR_SIDES], 0.2, (0.3, 200.0)
    ),
    # An even fan; the channels of the sensor are a little closer together in the middle.
    _spinning("QT64", _fan(52.1, -52.1, 64), 0.6, (0.1, 60.0)),
    # Compared in part with the PandarXT user's manual, section 1.3: one degree apart; not the single angles.
    _spinning("XT32", _fan(15.0, -16.0, 32), 0.18, (0.05, 120.0), noise_m=0.01),
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
