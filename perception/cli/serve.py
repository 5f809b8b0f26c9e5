"""`trifuse serve`."""

from pathlib import Path
from typing import Literal

from perception.cli.flags import SourceFlags
from perception.errors import UsageError
from perception.pipeline import PipelineConfig

_PIPELINE = PipelineConfig()


def serve(
    drive: Path | None = None,
    *,
    frames: SourceFlags,
    source: Literal["drive", "udp"] = "drive",
    port: int = 8765,
    host: str = "127.0.0.1",
    rate: float = 1.0,
    loop: bool = False,
    udp_port: int = 2368,
    pipeline: PipelineConfig = _PIPELINE,
) -> None:
    """Run the pipeline on a live LiDAR, or on a drive as if it were live; show the results in Foxglove and similar viewers.

    Frames that arrive while the pipeline is busy are dropped. Ctrl-C ends it.

    Example: trifuse serve 2011_09_26/2011_09_26_drive_0005_sync --loop

    Args:
        drive: Drive of any layout; none with --source udp.
        source: A drive, whose frames come at the times of their stamps, or udp, the packets of a Velodyne.
        port: Port to which viewers connect.
        host: Address of the network interface; 0.0.0.0 lets viewers of other computers connect.
        rate: Speed of the drive, 0.5 for half as fast.
        loop: Restart at the end of the drive.
        udp_port: Port at which packets of the LiDAR arrive.
        pipeline: Pipeline configuration.
    """
    from data.frames import further_camera_names
    from data.live.serve import ServerAddress, serve_live
    from data.live.source import PacedDrive
    from data.live.udp import UdpAddress, UdpLidar
    from data.open_drive import open_drive
    from perception.sensor import load_sensor

    if (drive is None) != (source == "udp"):
        raise UsageError(
            "serve", expected="a drive, or --source udp", found="both" if drive else "neither"
        )
    if rate <= 0:
        raise UsageError("--rate", expected="a number above 0", found=f"{rate:g}")
    score = pipeline.detection.display_score
    if drive is None:
        print(f"waiting for packets at UDP port {udp_port}", flush=True)
        sensor = load_sensor(frames.sensor) if frames.sensor else None
        lidar = UdpLidar(UdpAddress(udp_port), sensor)
        serve_live(lidar, pipeline, ServerAddress(host, port, score))
    else:
        opened = open_drive(drive, sequence=frames.sequence, config=frames.reading)
        address = ServerAddress(host, port, score, further_camera_names(opened))
        serve_live(PacedDrive(opened, rate=rate, is_endless=loop), pipeline, address)
