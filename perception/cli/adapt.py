"""`trifuse adapt`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from data.results.command_config import SECTION, CommandConfig
from export.adaptation_config import AdaptationConfig, LearnedLabels
from perception.cli.parser import FlagGroup, call
from perception.errors import optional_package


@dataclass(frozen=True)
class AdaptFlags(AdaptationConfig, FlagGroup):
    """Adaptation."""


def adapt(
    drives: list[Path],
    *,
    out: Path,
    adaptation: AdaptFlags,
    config: CommandConfig,
    network: Literal["bev", "rgb"] = "bev",
    sequence: str | None = None,
    learn: LearnedLabels = "labels",
    guard: tuple[Path, ...] = (),
) -> None:
    """Train a detector further on your drives, from above or of the camera; keep it only where it is better.

    A drive without labels is learned from proposals, which are made in OUT/labels/NAME; a review.json that is saved there
    counts. A stopped command goes on. OUT/bev_centers.onnx is for --pipeline.detection.bev-model, rgb_yolox.onnx for rgb-model.

    Example: trifuse adapt my_drive --out my_weights

    Args:
        drives: Drives of any layout, whose frames follow each other.
        out: Folder of the results.
        network: Detector from above, bev; or of the main camera's images, rgb.
        sequence: Sequence of a tracking folder.
        learn: Labels of the drives where there are some, or proposals for all.
        guard: Further labelled drives, with commas between them, on which nothing may be lost.
    """
    with optional_package("torch, onnx and onnxscript", needed_for="trifuse adapt", extra="train"):
        from export.adaptation import NETWORKS, Adaptation, expected_minutes
    from export.adapted_drives import open_adapted
    from perception.cli.label import label
    from perception.cli.progress import frame_progress_bar

    opened = open_adapted(drives, sequence, learn, out, images=network == "rgb")
    kind = NETWORKS[network]
    adapted = kind(adaptation.weights, opened[0].drive)
    made = Adaptation(adapted, opened, out, adaptation, guard)
    print(f"takes about {expected_minutes(opened, adapted, adaptation):.0f} minutes", flush=True)
    weights = [] if adaptation.weights is None else [kind.flag, str(adaptation.weights)]
    for one in opened:
        one.propose(lambda words: call("trifuse label", label, words), weights)
    report = made.run(lambda what: frame_progress_bar(what, delay_s=0))
    result = report.write(out, {SECTION: config.values})
    print(f"{report.table.text()}\n\n{result}\n{out / 'adapt.md'}")
