"""A detector adapted to drives: trained further on their labels or proposals, kept only if better.

    drives ── first frames ──┬─ training from the given weights ── model file ── measured on ─┬─ last frames of the drives
    synthetic scans ─────────┘                                                                └─ other synthetic scans: guard

Of each drive the last frames are kept apart. Synthetic scans are learned beside the drives, so that what was learned before is
not forgotten, and others are measured. What is measured lies on the line from the first weights to the trained ones, as far
along it as the guard allows: Wortsman et al., "Robust fine-tuning of zero-shot models", CVPR 2022.
"""

import shutil
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import torch

from data.array_store import entry_key
from data.label_proposals.proposed_labels import ProposedLabels, read_proposals
from data.open_drive import open_drive, open_drives
from data.recorded_drive import RecordedDrive
from data.splits.draw import split_in_time
from data.splits.files import write_split
from data.splits.frame_split import DriveParts, FrameSplit
from data.synthetic.collection import write_drives
from export.adaptation_config import AdaptationConfig
from export.adaptation_report import KEPT, MEAN, AdaptationReport, AdaptedPrecision, SetPrecision
from export.adapted_bev import AdaptedBev
from export.adapted_detector import AdaptedDetector
from export.adapted_drives import AdaptedDrive
from export.adapted_network import SENSORS, AdaptedNetwork, MeasuredClass
from export.onnx import Exportable
from export.variants import Network, torch_runner
from perception.atomic_file import write_atomically
from perception.detection.onnx_model import OnnxModel
from perception.errors import UsageError
from perception.types import Progress
from train.cli import fit
from train.folder import TrainingFolder

_SEEDS = {"learned": 73_000_000, "guard": 74_000_000}  # of streets that no shipped network has seen
_GUARD_SCANS = (
    20  # of each sensor: a gain there has a deviation of half a point, of 4 of each it has 1.4
)
_SHARES = (1.0, 0.8, 0.6, 0.4, 0.2)  # of the way from the first weights to the trained ones
_CALIBRATION = 32  # scans
_MEASURED_SCANS = 120  # of a set, evenly spread
_BATCH, _DECAY = 8, 0.99
OWN_LABELS, SYNTHETIC = f"{KEPT}, own labels", "synthetic"
SPLIT, _SYNTHETIC = "split.json", "synthetic"
Precision = dict[str, dict[str, MeasuredClass]]  # by set and class
NETWORKS: Mapping[str, type[AdaptedNetwork[Any]]] = {"bev": AdaptedBev, "rgb": AdaptedDetector}


def expected_minutes(
    drives: Sequence[AdaptedDrive], network: AdaptedNetwork[Any], config: AdaptationConfig
) -> float:
    """Return about how long an adaptation takes, by the time of the network on this machine.

    Args:
        drives: Drives, of which those without labels are labelled first.
        network: Network.
        config: Configuration.
    """
    costs = network.costs
    unlabelled = sum(len(one.drive) for one in drives if not one.is_labelled)
    synthetic = SENSORS * (config.scans + _GUARD_SCANS)
    passes = costs.label * unlabelled + costs.synthesis * synthetic
    passes += costs.sample * config.samples + costs.rest
    return passes * network.pass_ms() / 60e3


class WeightLine:
    """Weights between those of a file and those that a training made of them."""

    def __init__(self, network: AdaptedNetwork[Any], trained: Path) -> None:
        """Read both ends.

        Args:
            network: Network with the first weights.
            trained: Checkpoint with the last ones.

        Raises:
            ModelError: They are no weights of such a network.
        """
        self._exportable = network.exportable
        first, _ = network.load(network.file)
        self._network, self._metadata = network.load(trained)
        self._first, self._last = first.state_dict(), self._network.state_dict()

    def at(self, share: float) -> Exportable:
        """Return the network at a share of the way, 0 to 1."""
        mixed = {
            name: torch.lerp(self._first[name], last, share) if last.is_floating_point() else last
            for name, last in self._last.items()
        }
        network = deepcopy(self._network)
        network.load_state_dict(mixed)
        return self._exportable(network, self._metadata)


class Adaptation:
    """An adaptation in a folder; what an earlier one has finished there is used."""

    def __init__(
        self,
        network: AdaptedNetwork[Any],
        drives: Sequence[AdaptedDrive],
        out: Path,
        config: AdaptationConfig,
        guards: Sequence[Path] = (),
    ) -> None:
        """Take the drives.

        Args:
            network: Network with the weights to start from.
            drives: Drives to adapt to, with what is learned of each.
            out: Folder.
            config: Configuration.
            guards: Paths of further labelled drives that may not lose.

        Raises:
            UsageError: A drive is too short.
        """
        self._network, self._out, self._config = network, out, config
        self._drives = [one.drive for one in drives]
        self._guards = {
            f"{path.resolve().name} {one.name}": one
            for path in guards
            for one in open_drives([path], images=self._drives[0].has_images)
        }
        self._parts = split_in_time(self._drives, config.kept, config.gap_s)
        self._folders = {one.drive.name: one.proposals for one in drives if one.proposals}

    @cached_property
    def _proposals(self) -> Mapping[str, ProposedLabels]:
        return read_proposals(self._folders)

    def run(self, bars: Callable[[str], Progress]) -> AdaptationReport:
        """Adapt, and write the model file where it is better.

        Args:
            bars: Function from a description to the wrapper of a loop that shows its progress.

        Raises:
            PerceptionError: A drive cannot be read, or a file cannot be written.
        """
        config, network = self._config, self._network
        learned = self._synthetic("learned", config.scans, bars)
        guard = self._synthetic("guard", _GUARD_SCANS, bars)
        guards = {SYNTHETIC: network.samples(guard, _MEASURED_SCANS, {})} | {
            name: network.samples([one], _MEASURED_SCANS, {}) for name, one in self._guards.items()
        }
        # Drives are named as often as half of the samples are of them, of those that scale 8 bits, too.
        frames = sum(len(one.frames["train"]) for one in self._parts)
        repeats = max(round(sum(map(len, learned)) / frames), 1)
        split = FrameSplit((*repeats * self._parts, *(_all_of(drive) for drive in learned)))
        write_split(self._out / SPLIT, split)
        line = WeightLine(network, self._train(split, bars("scans")))
        drives = [*repeats * split.select(self._drives, "train"), *learned]
        examples = network.samples(drives, _CALIBRATION, self._proposals)
        sets = self._kept(split) | guards
        before = self._measure({"before": network.runner}, sets, bars("measuring"))["before"]
        for share in self._allowed(line, guards, before, bars("choosing")):
            content = network.content(line.at(share), examples)
            after = self._measure_file(content, sets, bars("measuring"))
            found = _compared(before, after)
            report = AdaptationReport(network.title, found, list(guards), config.max_lost, share)
            if not report.lost:
                break
        if report.is_better:
            write_atomically(self._out / network.out_file, content)
        shutil.rmtree(self._out / _SYNTHETIC)
        return report

    def _allowed(
        self,
        line: WeightLine,
        guards: Mapping[str, Any],
        before: Precision,
        progress: Progress,
    ) -> list[float]:
        """Return the shares of the way, largest first, at which no guard loses too much, and the smallest in any case."""
        networks = {f"{share:g}": torch_runner(line.at(share)) for share in _SHARES}
        measured = self._measure(networks, guards, progress)
        first = {name: before[name] for name in guards}
        allowed = []
        for share in _SHARES:
            found = _compared(first, measured[f"{share:g}"]).values()
            if share == _SHARES[-1] or all(
                one[MEAN].gain >= -self._config.max_lost for one in found
            ):
                allowed.append(share)
        return allowed

    def _measure_file(
        self, content: bytes, sets: Mapping[str, Any], progress: Progress
    ) -> Precision:
        """Return the precision of a model file."""
        with TemporaryDirectory() as folder:
            (file := Path(folder, self._network.out_file)).write_bytes(content)
            return self._measure({"after": OnnxModel(file, threads=1)}, sets, progress)["after"]

    def _measure(
        self, networks: Mapping[str, Network], sets: Mapping[str, Any], progress: Progress
    ) -> dict[str, Precision]:
        """Return the precision of networks by their name, by set and class."""
        result: dict[str, Precision] = {name: {} for name in networks}
        for of_set, samples in sets.items():
            for name, found in self._network.measure(networks, samples, progress).items():
                result[name][of_set] = found
        return result

    def _train(self, split: FrameSplit, progress: Progress) -> Path:
        """Train, and return the checkpoint of the last epoch."""
        config = self._config
        frames = sum(len(one.frames["train"]) for one in split.drives)
        epochs = max(round(config.samples / frames), 1)
        arguments = {
            **self._network.arguments(),
            "data.split": self._out / SPLIT, "data.proposals": {name: str(one) for name, one in self._folders.items()},
            "data.batch_size": _BATCH, "trainer.max_epochs": epochs,
            "trainer.check_val_every_n_epoch": epochs, "trainer.limit_val_batches": 1,
            "ema.decay": _DECAY, "optimizer.lr": config.lr, "seed_everything": config.seed,
        }  # fmt: skip
        # Proposals that were reviewed since are learned from the start.
        key = entry_key(labels=[one.fingerprint for one in self._proposals.values()])[:8]
        folder = TrainingFolder(self._out / "training" / key)
        try:
            fit(self._network.kind, arguments, folder.out, progress, self._network.training)
        except KeyboardInterrupt as error:
            raise KeyboardInterrupt("repeat the command") from error
        return folder.last

    def _kept(self, split: FrameSplit) -> dict[str, Any]:
        """Return the frames that are kept apart: with what is learned as labels, and with a drive's own beside proposals."""
        kept = split.select(self._drives, "val")
        own = [one for one in kept if one.has_labels and one.name in self._proposals]
        sets = {KEPT: self._network.samples(kept, _MEASURED_SCANS, self._proposals)}
        if own:
            sets[OWN_LABELS] = self._network.samples(own, _MEASURED_SCANS, {})
        return sets

    def _synthetic(
        self, part: str, scans: int, bars: Callable[[str], Progress]
    ) -> list[RecordedDrive]:
        """Return synthetic drives, which are made where they are missing."""
        recipes = self._network.synthetic(scans, _SEEDS[part])
        folders = {name: self._out / _SYNTHETIC / f"{part}-{name}-{scans}" for name in recipes}
        missing = [name for name, folder in folders.items() if not folder.exists()]
        for row in bars(f"synthetic scans, {part}")(range(len(missing))) if missing else ():
            name = missing[row]
            unfinished = folders[name].with_name(f"{folders[name].name}.part")
            write_drives(unfinished, recipes[name])
            unfinished.rename(folders[name])
        return [open_drive(folder) for folder in folders.values()]


def _compared(before: Precision, after: Precision) -> SetPrecision:
    """Return the precision of sets before and after, of the classes that have labels.

    Raises:
        UsageError: A set has no label that counts.
    """
    result = {}
    for name, of_set in before.items():
        every = {kind: AdaptedPrecision.of(one, after[name][kind]) for kind, one in of_set.items()}
        classes = {kind: one for kind, one in every.items() if one.labels}
        if not classes:
            expected = f"some {', '.join(of_set)} that can be seen"
            raise UsageError(name, expected=expected, found="none")
        result[name] = {**classes, MEAN: AdaptedPrecision.mean([*classes.values()])}
    return result


def _all_of(drive: RecordedDrive) -> DriveParts:
    return DriveParts(drive.root.resolve(), drive.name, {"train": drive.frame_names})
