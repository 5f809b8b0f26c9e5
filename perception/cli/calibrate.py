"""`trifuse calibrate`."""

from pathlib import Path
from typing import TYPE_CHECKING

from data.results.command_config import CommandConfig
from perception.cli.flags import ResultsFlags, SourceFlags, require_positive

if TYPE_CHECKING:
    from perception.calibration.recalibration import Recalibration
    from perception.evaluation.report import Table


def calibrate(
    root: Path,
    *,
    source: SourceFlags,
    results: ResultsFlags,
    config: CommandConfig,
    frames: int = 40,
) -> None:
    """Find the pose of the LiDAR in the camera's frame, by the edges of scans and images.

    The drive's own calibration is the start, and may be off by 3 degrees and 10 cm. Its file stays as it is: a copy with the
    calibration that was found is written to the results, with a figure of both.

    Example: trifuse calibrate kitti/tracking --sequence 0000 --out results/calibration

    Args:
        root: Folder or file of a drive with a camera, in any layout.
        frames: Number of frames, spread evenly over the drive.

    Raises:
        CalibrationError: The drive has no camera, or its scenes do not determine the calibration.
    """
    from data.calibration_files import read_calibrated_frames, write_calibration
    from data.open_drive import open_drive
    from data.results.documents import write_json
    from perception.calibration.recalibration import recalibrate
    from perception.cli.progress import frame_progress_bar
    from perception.render.calibration_plots import plot_recalibration

    require_positive("--frames", frames)
    drive = open_drive(root, sequence=source.sequence, config=source.reading)
    chosen = results.folder(config)
    read = read_calibrated_frames(drive, frames, frame_progress_bar(drive.name, delay_s=0))
    stated = read.calibration
    found = recalibrate(read.edges, drive.sensor, stated.source, read.tracks)
    folder = chosen.prepare()
    path, own = write_calibration(folder, drive, stated, found.cam_SE3_velo)
    write_json(folder / "calibration.json", found)
    plot_recalibration(
        folder / "calibration.png", drive.name, read.image, read.example, stated, found
    )
    print(_table(drive.name, found, read.left_out).text())
    print(f"\ncalibration: {path}" + (f", to be copied to {own}" if own else ""))
    print(f"figure: {folder / 'calibration.png'}")


def _table(title: str, found: "Recalibration", left_out: int) -> "Table[tuple[float, float]]":
    """Return the change of the calibration along each axis, and how sure it is."""
    import numpy as np

    from perception.evaluation.report import Column, Table

    scale = np.array([np.degrees(1)] * 3 + [100] * 3)
    values = np.column_stack([found.offset, found.deviations]) * scale[:, None]
    names = (
        "pitch, about the axis to the right [deg]", "yaw, about the axis down [deg]",
        "roll, about the optical axis [deg]", "to the right [cm]", "down [cm]", "ahead [cm]",
    )  # fmt: skip
    columns = (
        Column[tuple[float, float]]("change", lambda row: row[0], "+.2f"),
        Column[tuple[float, float]]("standard deviation", lambda row: row[1], ".2f"),
    )
    notes = [
        f"{found.edges} edges in {found.frames} frames; score {found.given_score:.3f} as stated, {found.score:.3f} as found",
        *([f"{left_out} frames of another calibration are left out"] if left_out else []),
    ]
    rows = {name: (float(row[0]), float(row[1])) for name, row in zip(names, values, strict=True)}
    return Table(
        f"{title}: calibration of LiDAR and camera",
        columns,
        rows,
        "LiDAR in the camera's frame",
        notes,
    )
