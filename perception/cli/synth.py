"""`trifuse synth`."""

from pathlib import Path

from data.results.command_config import CommandConfig
from data.synthetic.words import CameraName, StreetKind, SynthLayout


def synth(
    out: Path,
    *,
    config: CommandConfig,
    overwrite: bool = False,
    layout: SynthLayout = "raw",
    frames: int = 80,
    drives: int = 1,
    sensor: str = "HDL-64E",
    seed: int = 0,
    ins_noise_m: float = 0.02,
    ins_noise_deg: float = 0.1,
    images: bool = True,
    speed: float | None = None,
    street: StreetKind | None = None,
    night: bool = False,
    cameras: tuple[CameraName, ...] = ("front",),
    part: str | None = None,
) -> None:
    """Write synthetic drives in KITTI's layouts or as folders, with the exact class and motion of every point.

    The first drive is a busy street; the next ones are other kinds of streets.

    Example: trifuse synth drives --drives 3 --frames 100 --sensor VLP-16 --no-images

    Args:
        out: Folder for the drives.
        overwrite: Replace the drives that this command wrote there before; other files stay.
        layout: Folder layout; object frames come from many different streets, a folder holds several cameras.
        frames: Number of frames of each drive; of all streets together in the object layout.
        drives: Number of drives; the object layout makes as many streets as it needs.
        sensor: LiDAR model, such as HDL-64E, VLP-16 or OS1-64, or a .yaml or .json file that describes one.
        seed: Seed of the first drive; the same seed gives the same drive bit by bit.
        ins_noise_m: Standard deviation of the INS position along each axis, in metres.
        ins_noise_deg: Standard deviation of the INS roll, pitch and yaw, in degrees.
        images: Write the images of the colour camera.
        speed: Desired speed of the ego vehicle in metres per second; by default that of the street.
        street: Kind of street; by default a busy street first, then any kind except a jam.
        night: Render a night with the lamps of vehicles and a faint sky.
        cameras: Cameras of the vehicle, the main one first: front, front_left, front_right, left, right, rear.
        part: Part to write, such as 3/8, the third of eight, so that jobs of a cluster share the work.
    """
    from data.results.folder import ResultsFolder
    from data.synthetic.collection import SynthConfig, write_drives
    from data.synthetic.ins import InsNoise
    from perception.cli.progress import counting_bar
    from perception.sensor import load_sensor

    model, noise = load_sensor(sensor), InsNoise(ins_noise_m, ins_noise_deg)
    synth_config = SynthConfig(
        layout, frames, drives, model, seed, noise, images, street, speed, night, cameras
    )
    chosen = synth_config.named_part(part)
    if part is None:  # parts share the folder
        ResultsFolder.choose(out, config, overwrite=overwrite).prepare()
    with counting_bar("synth", chosen.frames) as bar:
        folders = write_drives(out, synth_config, bar.update, chosen)
    for folder in dict.fromkeys(folders):
        print(folder)
