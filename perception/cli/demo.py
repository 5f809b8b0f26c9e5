"""`trifuse demo`: a synthetic street, every stage on it, and a video; needs no data."""

import sys
from pathlib import Path

from tqdm import tqdm

from data.open_drive import open_drive
from data.synthetic.collection import SynthConfig, write_drives
from perception.cli.run import RunConfig, run_drive
from perception.sensor import load_sensor


def demo(
    *, out: Path = Path("results/demo"), frames: int = 60, sensor: str = "HDL-64E", seed: int = 0
) -> None:
    """Write a short synthetic drive, run every stage on it, and leave a video, results and a summary.

    Example: trifuse demo --sensor VLP-16

    Args:
        out: gets drive/ and the results.
        frames: how many; ten are a second.
        sensor: HDL-64E, HDL-32E, VLP-16, or a .json file.
        seed: of the street; another seed, another street.
    """
    synth_config = SynthConfig(frames=frames, sensor=load_sensor(sensor), seed=seed)
    with tqdm(total=frames, desc="writing a street", unit="frame", file=sys.stderr) as progress_bar:
        (folder,) = write_drives(out / "drive", synth_config, progress_bar.update)
    summary = run_drive(open_drive(folder), out, RunConfig())
    print(summary.table())
    print(f"watch:   {out / 'video.mp4'}")
