"""LiDARs that people have, by the data sheets and user manuals of their makers.

Values are of 10 revolutions or scans a second. Heights are those of KITTI's car (thesis 3.1.1): a file for --sensor that
names a model changes what differs. Units leave the line with calibrated elevations, up to 2 degrees from these.

Elevations that were compared, one by one, with a table of the maker name it. The others are even fans, or tables that no
manual at hand has confirmed: the field of view and the number of beams are the maker's, single angles may be off.
"""

from collections.abc import Sequence

import numpy as np

from perception.types import Float64, LidarModel

# User manual 63-9325 revision C, table 9-6, by laser ID; so they are in sweeps of a log of Argoverse 2, to 0.03 degrees.
VLP_32C_BY_LASER_DEG = (
    -25.0, -1.0, -1.667, -15.639, -11.31, 0.0, -0.667, -8.843, -7.254, 0.333, -0.333, -6.148, -5.333, 1.333, 0.667, -4.0,
    -4.667, 1.667, 1.0, -3.667, -3.333, 3.333, 2.333, -2.667, -3.0, 7.0, 4.667, -2.333, -2.0, 15.0, 10.333, -1.333,
)  # fmt: skip

# By laser ID, as two drivers that do not share their code have them of the manual.
VLS_128_BY_LASER_DEG = (
    -11.742, -1.99, 3.4, -5.29, -0.78, 4.61, -4.08, 1.31, -6.5, -1.11, 4.28, -4.41, 0.1, 6.48, -3.2, 2.19,
    -3.86, 1.53, -9.244, -1.77, 2.74, -5.95, -0.56, 4.83, -2.98, 2.41, -6.28, -0.89, 3.62, -5.07, 0.32, 7.58,
    -0.34, 5.18, -3.64, 1.75, -25.0, -2.43, 2.96, -5.73, 0.54, 9.7, -2.76, 2.63, -7.65, -1.55, 3.84, -4.85,
    3.18, -5.51, -0.12, 5.73, -4.3, 1.09, -16.042, -2.21, 4.06, -4.63, 0.76, 15.0, -3.42, 1.97, -6.85, -1.33,
    -5.62, -0.23, 5.43, -3.53, 0.98, -19.582, -2.32, 3.07, -4.74, 0.65, 11.75, -2.65, 1.86, -7.15, -1.44, 3.95,
    -2.1, 3.29, -5.4, -0.01, 4.5, -4.19, 1.2, -13.565, -1.22, 4.17, -4.52, 0.87, 6.08, -3.31, 2.08, -6.65,
    1.42, -10.346, -1.88, 3.51, -6.06, -0.67, 4.72, -3.97, 2.3, -6.39, -1.0, 4.39, -5.18, 0.21, 6.98, -3.09,
    4.98, -3.75, 1.64, -8.352, -2.54, 2.85, -5.84, -0.45, 8.43, -2.87, 2.52, -6.17, -1.66, 3.73, -4.96, 0.43,
)  # fmt: skip

# As the maker's drivers have them for units without a calibration, from the highest.
PANDAR_64_DEG = (
    14.882, 11.032, 8.059, 5.057, 3.04, 2.028, 1.86, 1.688, 1.522, 1.351, 1.184, 1.013, 0.846, 0.675, 0.508, 0.337,
    0.169, 0.0, -0.169, -0.337, -0.508, -0.675, -0.845, -1.013, -1.184, -1.351, -1.522, -1.688, -1.86, -2.028, -2.198,
    -2.365, -2.536, -2.7, -2.873, -3.04, -3.21, -3.375, -3.548, -3.712, -3.884, -4.05, -4.221, -4.385, -4.558, -4.72,
    -4.892, -5.057, -5.229, -5.391, -5.565, -5.726, -5.898, -6.061, -7.063, -8.059, -9.06, -9.885, -11.032, -12.006,
    -12.974, -13.93, -18.889, -24.897,
)  # fmt: skip

# The same, from the lowest.
QT_64_DEG = (
    -52.121, -49.785, -47.577, -45.477, -43.465, -41.528, -39.653, -37.831, -36.055, -34.32, -32.619, -30.95, -29.308,
    -27.69, -26.094, -24.517, -22.964, -21.42, -19.889, -18.372, -16.865, -15.368, -13.88, -12.399, -10.925, -9.457,
    -7.994, -6.535, -5.079, -3.626, -2.175, -0.725, 0.725, 2.175, 3.626, 5.079, 6.534, 7.993, 9.456, 10.923, 12.397,
    13.877, 15.365, 16.861, 18.368, 19.885, 21.415, 22.959, 24.524, 26.101, 27.697, 29.315, 30.957, 32.627, 34.328,
    36.064, 37.84, 39.662, 41.537, 43.475, 45.487, 47.587, 49.795, 52.133,
)  # fmt: skip
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
