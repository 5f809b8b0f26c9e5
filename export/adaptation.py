"""The detector of the bird's-eye view adapted to drives: trained further on their labels or proposals, kept only if better.

    drives ── first frames ──┬─ training from the given weights ── 8 bits ── measured on ─┬─ last frames of the drives
    synthetic scans ─────────┘                                                            └─ other synthetic scans: guard

Of each drive the last frames are kept apart. Synthetic scans of several sensors are learned beside the drives, so that what was
learned before is not forgotten, and others are measured. What is measured lies on the line from the first weights to the trained
ones, as far along it as the guard allows: Wortsman et al., "Robust fine-tuning of zero-shot models", CVPR 2022.
"""

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from data.array_store import ArrayStore, entry_key
from data.label_proposals.proposed_labels import ProposedLabels
from data.open_drive import open_drive, open_drives
from data.recorded_drive import RecordedDrive
from data.samples.bev.dataset import BevConfig, BevDataset
from data.samples.bev.labelled_scans import LabelledScans
from data.splits.draw import split_in_time
from data.splits.files import write_split
from data.splits.frame_split import DriveParts, FrameSplit
from data.synthetic.collection import SynthConfig, write_drives
from export.adaptation_config import AdaptationConfig
from export.adaptation_report import KEPT, MEAN, AdaptationReport, AdaptedPrecision, SetPrecision
from export.adapted_drives import AdaptedDrive
from export.bev import QUANTIZATION, exportable_network, measure_networks
from export.onnx import Exportable, to_onnx
from export.quantize import to_int8
from export.variants import Network, fastest_ms, torch_runner
from perception.atomic_file import write_atomically
from perception.detection.bev.detector import BevDetector
from perception.detection.networks import SHIPPED_BEV
from perception.detection.onnx_model import OnnxModel, shipped_model
from perception.errors import UsageError
from perception.sensor import HDL_64E, load_sensor
from perception.types import Progress
from train.bev.kind import BEV
from train.bev.networks import BevNetworkConfig, load_bev
from train.cli import fit
from train.folder import TrainingFolder

_SENSORS = ("HDL-64E", "HDL-32E", "VLP-16")
_SEEDS = {"learned": 73_000_000, "guard": 74_000_000}  # of streets that no shipped network has seen
_GUARD_SHARE = 3  # synthetic scans that are learned for each that is measured
# Times in those of a pass of the network: a frame to be labelled, a synthetic scan, a sample, and the rest.
_LABEL, _SYNTHESIS, _SAMPLE, _REST = 27, 30, 4.5, 6000
_SHARES = (1.0, 0.7, 0.4, 0.2)  # of the way from the first weights to the trained ones
_CALIBRATION = 32  # scans
_MEASURED_SCANS = 120  # of a set, evenly spread
_BATCH, _CROP, _DECAY = 8, 0.5, 0.99
_BEFORE, _AFTER = "before", "after"
OWN_LABELS, SYNTHETIC = f"{KEPT}, own labels", "synthetic"
SPLIT = "split.json"
MODEL_FILE = f"{SHIPPED_BEV}.onnx"


def initial_weights(config: AdaptationConfig) -> Path:
    """Return the model file to start from."""
    return config.weights or Path(str(shipped_model(SHIPPED_BEV)))


def expected_minutes(drives: Sequence[AdaptedDrive], config: AdaptationConfig) -> float:
    """Return about how long an adaptation takes, by the time of the network on this machine.

    Args:
        drives: Drives, of which those without labels are labelled first.
        config: Configuration.
    """
    detector = BevDetector(initial_weights(config), HDL_64E, threads=1)
    maps = {"maps": detector.preprocess(np.zeros((1, 4), np.float32))}
    unit_s = fastest_ms({"network": detector.model}, maps)["network"] / 1e3
    unlabelled = sum(len(one.drive) for one in drives if not one.is_labelled)
    synthetic = len(_SENSORS) * (config.scans + config.scans // _GUARD_SHARE)
    units = _LABEL * unlabelled + _SYNTHESIS * synthetic + _SAMPLE * config.samples + _REST
    return units * unit_s / 60


class WeightLine:
    """Weights between those of a file and those that a training made of them."""

    def __init__(self, initial: Path, trained: Path) -> None:
        """Read both ends; raise ModelError as `load_bev`."""
        first, _ = load_bev(initial)
        self._network, self._metadata = load_bev(trained)
        self._first, self._last = first.state_dict(), self._network.state_dict()

    def at(self, share: float) -> Exportable:
        """Return the network at a share of the way, 0 to 1."""
        mixed = {
            name: torch.lerp(self._first[name], last, share) if last.is_floating_point() else last
            for name, last in self._last.items()
        }
        network = deepcopy(self._network)
        network.load_state_dict(mixed)
        return exportable_network(network, self._metadata)


class Adaptation:
    """An adaptation in a folder; what an earlier one has finished there is used."""

    def __init__(
        self,
        drives: Sequence[AdaptedDrive],
        out: Path,
        config: AdaptationConfig,
        guards: Sequence[Path] = (),
    ) -> None:
        """Take the drives.

        Args:
            drives: Drives to adapt to, with what is learned of each.
            out: Folder.
            config: Configuration.
            guards: Paths of further labelled drives that may not lose.

        Raises:
            UsageError: A drive is too short.
            LabelError: Proposals cannot be read.
        """
        self._drives = [one.drive for one in drives]
        self._out, self._config = out, config
        self._guards = {
            f"{path.resolve().name} {one.name}": one
            for path in guards
            for one in open_drives([path], images=False)
        }
        self._parts = split_in_time(self._drives, config.kept, config.gap_s)
        self._folders = {one.drive.name: one.proposals for one in drives if one.proposals}
        self._proposals = {name: ProposedLabels(one) for name, one in self._folders.items()}

    @cached_property
    def _detector(self) -> BevDetector:
        return BevDetector(initial_weights(self._config), self._drives[0].sensor, threads=1)

    @cached_property
    def _network(self) -> BevNetworkConfig:
        return BevNetworkConfig.from_metadata(self._detector.model.metadata)

    def run(self, bars: Callable[[str], Progress]) -> AdaptationReport:
        """Adapt, and write the model file where it is better.

        Args:
            bars: Function from a description to the wrapper of a loop that shows its progress.

        Raises:
            PerceptionError: A drive cannot be read, or a file cannot be written.
        """
        config = self._config
        learned = self._synthetic("learned", config.scans, bars)
        guard = self._synthetic("guard", max(config.scans // _GUARD_SHARE, 1), bars)
        guards = {SYNTHETIC: self._samples(guard)}
        guards |= {name: self._samples([one], proposals={}) for name, one in self._guards.items()}
        # Drives are named as often as half of the samples are of them.
        frames = sum(len(one.frames["train"]) for one in self._parts)
        repeats = max(round(sum(map(len, learned)) / frames), 1)
        split = FrameSplit((*repeats * self._parts, *(_all_of(drive) for drive in learned)))
        write_split(self._out / SPLIT, split)
        line = WeightLine(initial_weights(config), self._train(split, bars("scans")))
        examples = self._samples([*split.select(self._drives, "train"), *learned], _CALIBRATION)
        maps = [{"maps": examples[row]["maps"].numpy()[None]} for row in range(len(examples))]
        sets = self._kept(split) | guards
        for share in self._allowed(line, guards, bars("choosing")):
            content = to_int8(to_onnx(line.at(share)), maps, QUANTIZATION)
            found = self._measure_file(content, sets, bars("measuring"))
            report = AdaptationReport(found, list(guards), config.max_lost, share)
            if not report.lost:
                break
        if report.is_better:
            write_atomically(self._out / MODEL_FILE, content)
        return report

    def _allowed(
        self, line: WeightLine, guards: Mapping[str, BevDataset], progress: Progress
    ) -> list[float]:
        """Return the shares of the way, largest first, at which no guard loses too much, and the smallest in any case."""
        networks = {f"{share:g}": torch_runner(line.at(share)) for share in _SHARES}
        measured = self._measure(networks, guards, progress)
        return [
            share
            for share in _SHARES
            if share == _SHARES[-1]
            or all(
                one[MEAN].gain >= -self._config.max_lost for one in measured[f"{share:g}"].values()
            )
        ]

    def _measure_file(
        self, content: bytes, sets: Mapping[str, BevDataset], progress: Progress
    ) -> SetPrecision:
        """Return the precision of a model file."""
        with TemporaryDirectory() as folder:
            (file := Path(folder, MODEL_FILE)).write_bytes(content)
            return self._measure({_AFTER: OnnxModel(file, threads=1)}, sets, progress)[_AFTER]

    def _train(self, split: FrameSplit, progress: Progress) -> Path:
        """Train, and return the checkpoint of the last epoch."""
        config, metadata = self._config, self._network
        frames = sum(len(one.frames["train"]) for one in split.drives)
        epochs = max(round(config.samples / frames), 1)
        arguments = {
            "data.split": self._out / SPLIT, "data.proposals": {name: str(one) for name, one in self._folders.items()},
            "data.batch_size": _BATCH, "data.augmentation.crop": _CROP,
            "model.weights": initial_weights(config), "model.classes": list(metadata.class_names),
            "model.reach_m": metadata.grid.reach_m, "model.cell_m": metadata.grid.cell_m,
            "trainer.max_epochs": epochs, "trainer.check_val_every_n_epoch": epochs, "trainer.limit_val_batches": 1,
            "ema.decay": _DECAY, "optimizer.lr": config.lr, "seed_everything": config.seed,
        }  # fmt: skip
        # Proposals that were reviewed since are learned from the start.
        key = entry_key(labels=[one.fingerprint for one in self._proposals.values()])[:8]
        folder = TrainingFolder(self._out / "training" / key)
        try:
            fit(BEV, arguments, folder.out, progress)
        except KeyboardInterrupt as error:
            raise KeyboardInterrupt("repeat the command") from error
        return folder.last

    def _kept(self, split: FrameSplit) -> dict[str, BevDataset]:
        """Return the scans that are kept apart: with what is learned as labels, and with a drive's own beside proposals."""
        kept = split.select(self._drives, "val")
        own = [one for one in kept if one.has_labels and one.name in self._proposals]
        sets = {KEPT: self._samples(kept)}
        return sets | ({OWN_LABELS: self._samples(own, proposals={})} if own else {})

    def _measure(
        self, networks: Mapping[str, Network], sets: Mapping[str, BevDataset], progress: Progress
    ) -> Mapping[str, SetPrecision]:
        """Return the precision of each of some networks beside the first weights, by set and class."""
        both: dict[str, Network] = {_BEFORE: self._detector.model, **networks}
        result: dict[str, dict[str, Mapping[str, AdaptedPrecision]]] = {one: {} for one in networks}
        for of_set, samples in sets.items():
            found = measure_networks(both, samples, self._detector, progress)
            first = {kind: one for kind, one in found[_BEFORE].items() if one.labels}
            if not first:
                names = ", ".join(self._network.class_names)
                raise UsageError(of_set, expected=f"some {names} with returns", found="none")
            for name, of_network in result.items():
                classes = {
                    kind: AdaptedPrecision.of(one, found[name][kind]) for kind, one in first.items()
                }
                of_network[of_set] = {**classes, MEAN: AdaptedPrecision.mean([*classes.values()])}
        return result

    def _samples(
        self,
        drives: Sequence[RecordedDrive],
        count: int = _MEASURED_SCANS,
        proposals: Mapping[str, ProposedLabels] | None = None,
    ) -> BevDataset:
        """Return scans of drives, evenly spread."""
        used = self._proposals if proposals is None else proposals
        scans = LabelledScans(drives, self._network.grid, ArrayStore(), used)
        numbers = np.linspace(0, len(scans) - 1, min(len(scans), count)).round().astype(int)
        return BevDataset(scans, numbers, BevConfig(self._network.grid, self._network.class_names))

    def _synthetic(
        self, part: str, scans: int, bars: Callable[[str], Progress]
    ) -> list[RecordedDrive]:
        """Return synthetic scans of each sensor, which are made where they are missing."""
        folders = {name: self._out / "synthetic" / f"{part}-{name}-{scans}" for name in _SENSORS}
        missing = [name for name, folder in folders.items() if not folder.exists()]
        rows = range(len(missing))
        for row in bars(f"synthetic scans, {part}")(rows) if missing else ():
            name = missing[row]
            synth = SynthConfig(
                "object", scans, sensor=load_sensor(name), images=False, seed=_SEEDS[part]
            )
            unfinished = folders[name].with_name(f"{folders[name].name}.part")
            write_drives(unfinished, synth)
            unfinished.rename(folders[name])
        return [open_drive(folder) for folder in folders.values()]


def _all_of(drive: RecordedDrive) -> DriveParts:
    return DriveParts(drive.root.resolve(), drive.name, {"train": drive.frame_names})
