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
    """Run the pipeline on a live LiDAR, or on a drive as if it were live; show the results in Foxglove or the like.

    Frames that come while the pipeline is busy are dropped, so that nothing lags. Ctrl-C ends it.

    Example: trifuse serve 2011_09_26/2011_09_26_drive_0005_sync --loop

    Args:
        drive: Drive of any layout; none with --source udp.
        source: A drive, whose frames come at the times of their stamps, or udp, the packets of a Velodyne VLP-16 or HDL-32E.
        port: Port to which viewers connect.
        host: Address of the network interface; 0.0.0.0 lets viewers of other computers connect.
        rate: Speed of the drive, 0.5 for half as fast.
        loop: Begin again at the end of the drive.
        udp_port: Port at which packets of the LiDAR arrive.
        pipeline: Pipeline configuration.

    Raises:
        UsageError: There is no drive or one too many, or a port is not free.
    """
    from data.frames import further_camera_names
    from data.live.serve import LiveCounts, serve_results
    from data.live.server import ResultServer
    from data.live.source import LiveSource, PacedDrive
    from data.live.udp import UdpAddress, UdpLidar
    from data.open_drive import open_drive
    from perception.pipeline import Pipeline
    from perception.sensor import load_sensor

    if (drive is None) != (source == "udp"):
        raise UsageError(
            "serve", expected="a drive, or --source udp", found="both" if drive else "neither"
        )
    if rate <= 0:
        raise UsageError("--rate", expected="a number above 0", found=f"{rate:g}")
    live: LiveSource
    cameras: tuple[str, ...] = ()
    if drive is None:
        print(f"waiting for packets at UDP port {udp_port}", flush=True)
        live = UdpLidar(UdpAddress(udp_port), load_sensor(frames.sensor) if frames.sensor else None)
    else:
        opened = open_drive(drive, sequence=frames.sequence, config=frames.reading)
        cameras = further_camera_names(opened)
        live = PacedDrive(opened, rate=rate, is_endless=loop)
    counts = LiveCounts()
    min_score = pipeline.detection.display_score
    with (
        ResultServer(live.name, host, port, min_score=min_score, cameras=cameras) as server,
        Pipeline(live.sensor, pipeline) as stages,
    ):
        print(
            f"{live.name}: connect a viewer of Foxglove's protocol to {server.address}", flush=True
        )
        try:
            serve_results(live, stages, server, counts)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(counts.text()) from None
    print(counts.text())
