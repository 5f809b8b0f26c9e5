"""`trifuse calibrate`."""

from pathlib import Path

from data.results.command_config import CommandConfig
from perception.cli.flags import ResultsFlags, SourceFlags, require_positive


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
    """
    from data import calibration_files as files
    from data.open_drive import open_drive
    from data.results.documents import write_json
    from perception.calibration.recalibration import recalibrate
    from perception.cli.progress import frame_progress_bar
    from perception.render.calibration_plots import plot_recalibration

    require_positive("--frames", frames)
    drive = open_drive(root, sequence=source.sequence, config=source.reading)
    chosen = results.folder(config)
    read = files.read_calibrated_frames(drive, frames, frame_progress_bar(drive.name, delay_s=0))
    stated = read.calibration
    found = recalibrate(read.edges, drive.sensor, stated.source, read.tracks)
    folder = chosen.prepare()
    path, own = files.write_calibration(folder, drive, stated, found.cam_SE3_velo)
    write_json(folder / "calibration.json", found)
    figure = folder / "calibration.png"
    plot_recalibration(figure, drive.name, read.image, read.example, stated, found)
    print(files.recalibration_table(drive.name, found, read.left_out).text())
    print(f"\ncalibration: {path}" + (f", to be copied to {own}" if own else ""))
    print(f"figure: {figure}")
