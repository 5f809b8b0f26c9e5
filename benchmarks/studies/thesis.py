"""The experiments of 7.2, whole: commands that split, train and measure, each run once, and what they add up to.

OUT/commands.json          commands that are done, which are not repeated
    split.json             60 % of the frames train, 20 % validate, 20 % test
    rgb/ dm/ rm/           YOLOv2-C, YOLOv2-D and YOLOv2-R
    without/ with/         DepthCN's network, trained without and with augmentation
    scores/ features/      fusion on three scores, and on 23 features
    tables.txt tables.json Tables 7.8, 7.9 and 7.10 beside the printed ones
    figure-7.8.jpg ...     Figs 7.8 to 7.16, on the test frames
"""

import json
import os
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from data.results.documents import write_json
from perception.cli.flags import require_positive
from perception.cli.main import run_command_line
from perception.cli.parser import FlagGroup
from perception.errors import UsageError
from perception.types import MODALITIES
from train.folder import LAST

FULL_STEPS = 80_200  # of each detector (7.2.2)
_SYNTHETIC_FRAMES, _SYNTHETIC_TRACK = 20, 22  # a pedestrian of the first synthetic street


@dataclass(frozen=True)
class ThesisExperiments(FlagGroup):
    """Experiments.

    Attributes:
        data: Labelled object frames; else those in the folder KITTI_ROOT; else synthetic ones.
        frames: Number of synthetic frames.
        detectors: Configuration of the three detectors: thesis, which is YOLOv2 as in 7.2.2; or default, a network
            that two cores can train.
        steps: Number of steps of each detector.
        epochs: Number of epochs of DepthCN's network.
        fit_steps: Maximum number of steps of each fit of the fusion by Levenberg-Marquardt.
        neurons: Numbers of neurons of one hidden layer that are compared (Fig. 7.13).
        seed: Seed of frames, split and trainings.
    """

    data: Path | None = None
    frames: int = 300
    detectors: Literal["thesis", "default"] = "thesis"
    steps: int = FULL_STEPS
    epochs: int = 40
    fit_steps: int = 1000
    neurons: tuple[int, ...] = (5, 11, 17, 23, 29, 35, 41)
    seed: int = 0

    def __post_init__(self) -> None:
        """Validate the numbers of frames, steps and epochs."""
        for name in ("frames", "steps", "epochs", "fit-steps"):
            require_positive(f"--{name}", getattr(self, name.replace("-", "_")))

    @property
    def kitti(self) -> Path | None:
        """Folder of KITTI's data, where there is one."""
        root = Path(os.environ.get("KITTI_ROOT", ""))
        return root if self.data is None and (root / "object").is_dir() else None


def thesis(*, experiments: ThesisExperiments, out: Path = Path("results/thesis")) -> None:
    """Train and measure all that 7.2 reports: Tables 7.8 to 7.10 and Figs 7.8 to 7.16, beside the printed values.

    A command that is done is not repeated, and a training that was stopped is resumed.

    Example: trifuse study thesis --detectors default --steps 100 --frames 100 --epochs 4 --fit-steps 15

    Args:
        out: Folder of the results.
    """
    from benchmarks.studies.thesis_report import report

    done = _Done(out / "commands.json")
    for name, words in commands(experiments, out).items():
        done.run(name, words)
    report(out, {"experiments": experiments})


def commands(experiments: ThesisExperiments, out: Path) -> dict[str, list[str]]:
    """Return the commands of the experiments by name, in their order."""
    split, seed = out / "split.json", f"--seed {experiments.seed}"
    data = _data_folder(experiments, out)
    on_test = f"evaluate detection {data} --split {split} --part test --recall-points 11 --iou 0.7"
    models = " ".join(f"--detection.{name}-model {out / name}.onnx" for name in MODALITIES)
    lines = dict(_data_commands(experiments, out))
    lines |= dict(_detector_commands(experiments, out))
    for name, flag in (("without", "--data.augment false"), ("with", "--data.augment true")):
        flags = f"--config thesis {flag} --epochs {experiments.epochs} {seed}"
        lines[name] = f"train depthcn --split {split} {flags} --out {out / name}"
    lines["depthcn"] = f"export {out / 'with/best.ckpt'} --out {out / 'depthcn.onnx'}"
    fused = " ".join(f"--data.models.{name} {out / name}.onnx" for name in MODALITIES)
    neurons = ",".join(map(str, experiments.neurons))
    for name, of_variant in (
        ("scores", "--model.variant scores --model.hidden 41"),
        ("features", f"--model.variant features --model.sweep.one {neurons}"),
    ):
        flags = f"--config thesis {of_variant} --epochs {experiments.fit_steps} {fused} {seed}"
        lines[name] = f"train fusion --split {split} {flags} --out {out / name}"
    depthcn = f"--detector depthcn --detection.depthcn.model {out / 'depthcn.onnx'}"
    lines["test of DepthCN"] = f"{on_test} {depthcn} --json {out / 'depthcn.json'}"
    fusions = f"--fusions {out / 'scores/fusion.onnx'}"
    own = f"--detection.fusion-model {out / 'features/fusion.onnx'}"
    lines["test of the fusion"] = f"{on_test} {models} {own} {fusions} --json {out / 'fusion.json'}"
    return {name: shlex.split(line) for name, line in lines.items()}


def _data_folder(experiments: ThesisExperiments, out: Path) -> Path:
    if experiments.data is not None:
        return experiments.data
    return out / "data" if experiments.kitti is None else experiments.kitti / "object"


def _data_commands(experiments: ThesisExperiments, out: Path) -> Iterator[tuple[str, str]]:
    """Yield the commands that write frames where there are none, split them, and track one object."""
    seed, kitti = f"--seed {experiments.seed}", experiments.kitti
    data = _data_folder(experiments, out)
    if data == out / "data":
        yield "data", f"synth {data} --layout object --frames {experiments.frames} {seed}"
    yield "split", f"split {data} --shares 60,20,20 {seed} --out {out / 'split.json'}"
    objects = f"{kitti}/tracking"
    if kitti is None:
        sequence = out / "sequence"
        yield "sequence", f"synth {sequence} --layout tracking --frames {_SYNTHETIC_FRAMES}"
        objects = f"{sequence} --set present --track-id {_SYNTHETIC_TRACK}"
    yield "tracked", f"study tracking-results {objects} --out {out / 'figure-7.8.jpg'}"


def _detector_commands(experiments: ThesisExperiments, out: Path) -> Iterator[tuple[str, str]]:
    """Yield the commands that train the three detectors and write their model files."""
    flags = f"--config {experiments.detectors} --steps {experiments.steps}"
    flags += f" --seed {experiments.seed}"
    for name in MODALITIES:
        train = f"train detector --split {out / 'split.json'} --modality {name}"
        yield name, f"{train} {flags} --out {out / name}"
        file = f"{name}.onnx"
        yield file, f"export {out / name / 'best.ckpt'} --out {out / file}"


class _Done:
    """Commands that are done, in a file."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._lines: dict[str, str] = json.loads(file.read_text()) if file.exists() else {}

    def run(self, name: str, words: list[str]) -> None:
        """Run a command that is not done; resume a training that was stopped.

        Raises:
            UsageError: Another command of this name is done.
            PerceptionError: The command cannot be run.
        """
        line = shlex.join(["trifuse", *words])
        known = self._lines.get(name)
        if known == line:
            return
        if known is not None:
            raise UsageError(
                self._file,
                expected=f"{line}, or nothing of that name",
                found=known,
                advice="choose another --out",
            )
        print(f"\n$ {line}", flush=True)
        run_command_line([*words, *_resume(words)])
        self._lines[name] = line
        write_json(self._file, self._lines)


def _resume(words: list[str]) -> list[str]:
    is_training = words[0] == "train"
    last = Path(words[words.index("--out") + 1]) / LAST if is_training else None
    return ["--resume", "last"] if last is not None and last.exists() else []
