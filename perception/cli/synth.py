"""`trifuse synth`: synthetic drives in KITTI's layouts."""

from pathlib import Path

from tqdm import tqdm

from data.synthetic.collection import SynthConfig, write_drives
from data.synthetic.ins import InsNoise
from data.synthetic.writer import Layout
from perception.sensor import load_sensor


def synth(  # noqa: PLR0913 - flags of a command
    out: Path,
    *,
    layout: Layout = "raw",
    frames: int = 80,
    drives: int = 1,
    sensor: str = "HDL-64E",
    seed: int = 0,
    ins_noise_m: float = 0.02,
    ins_noise_deg: float = 0.1,
    images: bool = True,
    speed: float | None = None,
) -> None:
    """Write synthetic drives in KITTI's layouts, with exact truth of every point.

    The first drive is a lively street; further ones are streets of other kinds.

    Example: trifuse synth drives --drives 3 --frames 100 --sensor VLP-16 --images false

    Args:
        out: gets the folder of the date (raw) or the folder training (tracking, object).
        layout: raw, tracking, or object; object frames come from many different worlds.
        frames: frames of each drive; frames of all worlds together in the object layout.
        drives: how many drives; the object layout takes as many worlds as it needs.
        sensor: HDL-64E, HDL-32E, VLP-16, or a .json file.
        seed: of the first drive; the same seed gives the same drive bit by bit.
        ins_noise_m: standard deviation of the INS position along each axis, metres.
        ins_noise_deg: standard deviation of the INS roll, pitch and yaw, degrees.
        images: whether to write images of the colour camera.
        speed: that the ego vehicle wishes for, metres a second; else as the street is drawn.
    """
    synth_config = SynthConfig(
        layout=layout,
        frames=frames,
        drives=drives,
        sensor=load_sensor(sensor),
        seed=seed,
        noise=InsNoise(ins_noise_m, ins_noise_deg),
        images=images,
        ego_m_s=speed,
    )
    with tqdm(total=synth_config.total_frames, desc="synth", unit="frame") as progress_bar:
        folders = write_drives(out, synth_config, progress_bar.update)
    for folder in dict.fromkeys(folders):
        print(folder)
