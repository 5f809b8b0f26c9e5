"""`trifuse demo`."""

from pathlib import Path

from data.results.command_config import CommandConfig


def demo(
    *,
    config: CommandConfig,
    out: Path = Path("results/demo"),
    frames: int = 60,
    sensor: str = "HDL-64E",
    seed: int = 0,
    stages: bool = False,
) -> None:
    """Write a short synthetic drive and run every stage on it; needs no data.

    Writes a video, the result files and a summary, and replaces those of an earlier demo.

    Example: trifuse demo --sensor VLP-16

    Args:
        out: Folder for the drive and the results.
        frames: Number of frames, ten a second.
        sensor: LiDAR model, such as HDL-64E, VLP-16 or OS1-64, or a .yaml or .json file that describes one.
        seed: Seed of the street.
        stages: Also print the time of each stage.
    """
    from data.open_drive import open_drive
    from data.pipeline_results import pipeline_results
    from data.results.folder import ResultsFolder
    from data.results.run_config import RunConfig
    from data.results.run_drive import run_drive
    from data.synthetic.collection import SynthConfig, write_drives
    from perception.cli.progress import compile_functions, counting_bar, progress_bar
    from perception.sensor import load_sensor

    synth_config = SynthConfig(frames=frames, sensor=load_sensor(sensor), seed=seed)
    results_folder = ResultsFolder.choose(out, config, overwrite=True)
    recipe = CommandConfig("synth", config.values)
    street = ResultsFolder.choose(out / "drive", recipe, overwrite=True).prepare()
    compile_functions()
    with counting_bar("writing a street", frames) as bar:
        (folder,) = write_drives(street, synth_config, bar.update)
    drive, run_config = open_drive(folder), RunConfig()
    results = pipeline_results(drive, run_config.pipeline, progress=progress_bar)
    print(run_drive(drive, results, results_folder, run_config).text(stages=stages))
    print(f"video: {out / 'video.mp4'}")
