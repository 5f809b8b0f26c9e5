"""All kinds of faults: their functions, sizes and the names by which monitors report them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from data.faults import camera, ins, lidar
from data.faults.moment import FaultFunction
from perception.types import CALIBRATION, CAMERA, INS, LIDAR


@dataclass(frozen=True)
class FaultKind:
    """One kind of fault.

    Attributes:
        part: Sensor that fails.
        make: Function that makes a frame of the fault.
        size: Name and unit of the size; empty where there is none.
        default: Size where none is given.
        sizes: Sizes of a curve, in rising order.
        reported: Names of the fault in a health, any of them.
    """

    part: str
    make: FaultFunction
    size: str
    default: float
    sizes: tuple[float, ...]
    reported: tuple[str, ...]


# By the names of the command line.
FAULT_KINDS: Final[Mapping[str, FaultKind]] = {
    "camera-dark": FaultKind(CAMERA, camera.dark, "stops", 9, (2, 4, 6, 8, 10), ("camera dark",)),
    "camera-frozen": FaultKind(CAMERA, camera.frozen, "", 1, (1,), ("camera frozen",)),
    "camera-washed-out": FaultKind(
        CAMERA, camera.washed_out, "share", 0.85, (0.3, 0.5, 0.7, 0.85, 1), ("camera washed out",)
    ),
    "camera-dirty": FaultKind(
        CAMERA, camera.dirty, "share", 0.35, (0.1, 0.2, 0.35, 0.5), ("camera blurred",)
    ),
    "camera-blurred": FaultKind(
        CAMERA, camera.blurred, "pixels", 3, (1, 2, 3, 5), ("camera blurred",)
    ),
    "camera-missing": FaultKind(CAMERA, camera.missing, "", 1, (1,), ("camera missing",)),
    "lidar-sector": FaultKind(
        LIDAR, lidar.sector_lost, "degrees", 40, (10, 20, 40, 90, 180), ("sector lost", "scan lost")
    ),
    "lidar-beams": FaultKind(
        LIDAR, lidar.beams_lost, "share", 0.15, (0.05, 0.15, 0.3, 0.5), ("beams lost", "scan lost")
    ),
    "lidar-fog": FaultKind(
        LIDAR, lidar.fog, "share", 0.1, (0.01, 0.03, 0.1, 0.3), ("scattered returns", "scan lost")
    ),
    "lidar-lost": FaultKind(
        LIDAR, lidar.scan_lost, "share", 1, (0.5, 0.9, 0.99, 1), ("scan lost",)
    ),
    "lidar-repeated": FaultKind(LIDAR, lidar.scan_repeated, "", 1, (1,), ("scan repeated",)),
    "lidar-late": FaultKind(
        LIDAR, lidar.scan_late, "seconds", 0.08, (0.02, 0.05, 0.08), ("scan late",)
    ),
    "lidar-out-of-order": FaultKind(
        LIDAR, lidar.scan_out_of_order, "seconds", 0.15, (0.15, 0.35), ("scan out of order",)
    ),
    "time-jump": FaultKind(
        LIDAR, lidar.time_jump, "seconds", 10, (-100, -1, 2, 10), ("time jump", "scan late")
    ),
    "ins-absent": FaultKind(INS, ins.absent, "", 1, (1,), ("INS absent",)),
    "ins-frozen": FaultKind(INS, ins.frozen, "", 1, (1,), ("INS frozen",)),
    "ins-jumping": FaultKind(
        INS, ins.jumping, "metres", 2, (0.3, 0.5, 1, 2, 10), ("INS jumping", "INS drifting")
    ),
    "ins-drifting": FaultKind(
        INS, ins.drifting, "m/s", 5, (0.5, 1, 2, 4, 8), ("INS drifting", "INS jumping")
    ),
    "ins-turning": FaultKind(
        INS, ins.turning, "degrees/s", 12, (2, 5, 12, 20), ("INS drifting", "INS jumping")
    ),
    "calibration-yaw": FaultKind(
        CALIBRATION, camera.turned_aside, "degrees", 1, (0.5, 1, 2, 3, 5), ("calibration off",)
    ),
    "calibration-pitch": FaultKind(
        CALIBRATION, camera.tilted, "degrees", 1, (0.5, 1, 2, 3, 5), ("calibration off",)
    ),
    "calibration-shift": FaultKind(
        CALIBRATION, camera.shifted, "metres", 0.1, (0.05, 0.1, 0.2, 0.5), ("calibration off",)
    ),
}
