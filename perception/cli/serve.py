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
    ros: bool = False,
    pipeline: PipelineConfig = _PIPELINE,
) -> None:
    """Run the pipeline on a live LiDAR, or on a drive as if it were live; show the results in Foxglove and similar viewers.

    Frames that arrive while the pipeline is busy are dropped. Ctrl-C ends it.

    Example: trifuse serve 2011_09_26/2011_09_26_drive_0005_sync --loop

    Args:
        drive: Drive of any layout; none with --source udp, nor for the topics of a robot with --ros.
        source: A drive, whose frames come at the times of their stamps, or udp, the packets of a Velodyne or Ouster.
        port: Port to which viewers connect.
        host: Address of the network interface; 0.0.0.0 lets viewers of other computers connect.
        rate: Speed of the drive, 0.5 for half as fast.
        loop: Restart at the end of the drive.
        udp_port: Port at which packets of the LiDAR arrive.
        ros: Publish the results on topics of ROS 2 as well; without a drive, read the topics of a robot.
        pipeline: Pipeline configuration.
    """
    from data.dds.serve_ros import serve_ros
    from data.live.serve import ServerAddress, serve_live
    from data.live.source import LiveSource, PacedDrive
    from data.live.udp import open_udp
    from data.open_drive import open_drive

    is_udp = source == "udp"
    if (drive is None) != is_udp and not (ros and drive is None):
        found = "both" if drive else "neither"
        raise UsageError("serve", expected="a drive, or --source udp", found=found)
    if rate <= 0:
        raise UsageError("--rate", expected="a number above 0", found=f"{rate:g}")
    live: LiveSource | None = open_udp(udp_port, frames.sensor) if is_udp else None
    if drive is not None:
        opened = open_drive(drive, sequence=frames.sequence, config=frames.reading)
        live = PacedDrive(opened, rate=rate, is_endless=loop)
    address = ServerAddress(host, port, pipeline.detection.display_score)
    if ros:
        serve_ros(live, frames.reading, pipeline, address)
    elif live is not None:
        serve_live(live, pipeline, address)
