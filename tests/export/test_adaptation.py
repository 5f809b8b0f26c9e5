"""A detector from above is adapted to a drive in a few steps, and is used only where it is better."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
import torch

from data.label_proposals.proposals import Proposal, ProposalFile
from data.open_drive import open_drive
from data.synthetic.collection import SynthConfig, write_drives
from export import adaptation, adapted_bev, adapted_detector
from export.adaptation import WeightLine
from export.adaptation_config import AdaptationConfig
from export.adaptation_report import KEPT, MEAN, AdaptationReport, AdaptedPrecision
from export.adapted_bev import AdaptedBev
from export.adapted_detector import AdaptedDetector
from export.adapted_drives import open_adapted
from export.bev import exportable_network as exportable_bev
from export.bev import random_maps
from export.detector import exportable_network
from export.onnx import to_onnx
from perception.cli.main import main
from perception.detection.bev.bev_map import CHANNELS, BevGrid
from perception.detection.detectors.input_size import InputSize
from perception.errors import UsageError
from perception.sensor import VLP_16
from perception.types import Boxes3D
from tests.faults import command, fault
from train.bev.networks import BevNetworkConfig, load_bev
from train.detector.networks import DetectorNetworkConfig, make_detector
from train.networks.bev_centers import BevCenters

CONFIG = BevNetworkConfig(BevGrid(reach_m=25.6, cell_m=0.4), ("Car", "Truck"))


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    """Return a small model file that knows nothing."""
    torch.manual_seed(0)
    network = BevCenters(CONFIG.class_names, CHANNELS)
    maps = random_maps((2, 32, 32, 16, CHANNELS), np.random.default_rng(1))["maps"]
    with torch.no_grad():
        for _ in range(10):
            network.train()(torch.from_numpy(maps))
    file = tmp_path_factory.mktemp("weights") / "small.onnx"
    file.write_bytes(to_onnx(exportable_bev(network.eval(), CONFIG.metadata)))
    return file


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Return a sequence of 8 frames in 0.7 s."""
    synth_config = SynthConfig(layout="tracking", frames=8, sensor=VLP_16, seed=4, street="jam")
    [folder] = write_drives(tmp_path_factory.mktemp("drive"), synth_config)
    return folder


FLAGS = "--learn proposals --scans 1 --samples 20 --kept 0.25 --gap-s 0.15"


@pytest.fixture
def words(drive, weights, tmp_path, monkeypatch):
    monkeypatch.setattr(adapted_bev, "_SENSORS", ("VLP-16",))
    monkeypatch.setattr(adaptation, "_GUARD_SCANS", 1)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return f"adapt {drive} --out {tmp_path}/out --weights {weights} {FLAGS}".split()


def propose(drive, box, out):
    """Write proposals of one car that stays at a box in all frames."""
    one = Proposal(1, "Car", 0.9, False, np.arange(8), Boxes3D.concatenate([box] * 8), np.full(8, 9), 0)  # fmt: skip
    names, poses = dict(enumerate(drive.frame_names)), dict.fromkeys(range(8), np.eye(4))
    ProposalFile([one], poses, names).write(out / "labels" / drive.name)


def test_a_drive_is_learned_and_measured_on_its_end(drive, words, tmp_path, capsys):
    out, opened = tmp_path / "out", open_drive(drive)
    propose(opened, opened.labels(7).boxes_velo[:1], out)
    assert main(words) == 0
    assert capsys.readouterr().out.startswith("takes about ")
    own = json.loads((out / "split.json").read_text())["drives"][0]
    assert (own["train"], own["val"]) == ([f"{n:06d}" for n in range(5)], ["000006", "000007"])
    report = json.loads((out / "adapt.json").read_text())
    assert set(report["sets"]) == {KEPT, "kept apart, own labels", "synthetic"}
    assert report["sets"][KEPT]["Car"]["labels"] == 2
    assert report["sets"]["kept apart, own labels"][MEAN]["labels"] > 10
    assert report["is_better"] == (out / "bev_centers.onnx").is_file() == (not report["reasons"])
    assert report["configuration"]["samples"] == 20
    assert "kept apart, mean" in (out / "adapt.md").read_text()
    assert (out / "adapt.png").stat().st_size > 1000
    assert not (out / "synthetic").exists()
    # What is finished is not made again.
    [checkpoint] = (out / "training").glob("*/last.ckpt")
    written = checkpoint.stat().st_mtime_ns
    assert main(words) == 0
    assert checkpoint.stat().st_mtime_ns == written
    assert json.loads((out / "adapt.json").read_text())["sets"] == report["sets"]
    with fault(UsageError, expected="a training with the same settings", advice="another --out"):
        command(*words, "--lr", "0.1")


def test_a_camera_learns_proposals_in_its_image(drive, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(adaptation, "_SHARES", (1.0,))
    monkeypatch.setattr(adaptation, "_GUARD_SCANS", 1)
    monkeypatch.setattr(adapted_detector, "SENSORS", 2)
    out, opened, weights = tmp_path / "out", open_drive(drive), tmp_path / "small.onnx"
    size = {"modality": "rgb", "network": "yolox-nano", "size": InputSize(64, 192)}
    config = DetectorNetworkConfig(class_names=("Car",), **size)
    torch.manual_seed(0)
    network = make_detector(config)
    for level in network.head.levels:  # so that something is detected
        level.objectness.bias.data.fill_(1.0)
        level.classes.bias.data.fill_(1.0)
    weights.write_bytes(to_onnx(exportable_network(network.eval(), config.metadata)))
    box = Boxes3D(np.array([[9.0, 0.0, -1.7]]), np.array([[4.0, 1.8, 1.5]]), np.zeros(1))
    propose(opened, box, out)
    flags = f"--network rgb --out {out} --weights {weights} {FLAGS}"
    assert main(["adapt", str(drive), *flags.split()]) == 0
    report = json.loads((out / "adapt.json").read_text())
    assert report["measured"].startswith("precision in the image")
    assert report["sets"][KEPT]["Car"]["labels"] == 2
    assert report["is_better"] == (out / "rgb_yolox.onnx").is_file()
    [checkpoint] = (out / "training").glob("*/last.ckpt")
    adapted = AdaptedDetector(weights, opened)
    trained, stated = adapted.load(checkpoint)
    assert stated["input_width"] == "192"
    written = adapted.exportable(trained, stated).metadata
    assert (written["input_height"], written["network"]) == ("64", "yolox-nano")


def test_a_drive_that_is_too_short_is_refused_before_it_is_labelled(words, tmp_path):
    with fault(UsageError, "kept apart", "a gap of 9 s", "8 frames", "take a longer drive"):
        command(*words, "--gap-s", "9")
    assert not (tmp_path / "out" / "labels").exists()


def test_labels_are_proposed_where_there_are_none(drive, tmp_path):
    calls = []
    for learned in ("labels", "proposals"):
        [one] = open_adapted([drive], None, learned, tmp_path, images=False)
        one.propose(calls.append, ["--pipeline.detection.bev-model", "own.onnx"])
    folder = tmp_path / "labels" / one.drive.name
    sequence = [] if one.sequence is None else ["--sequence", one.sequence]
    detector = ["--pipeline.detection.bev-model", "own.onnx"]
    assert calls == [[str(drive), "--out", str(folder), "--resume", *sequence, *detector]]
    folder.mkdir(parents=True)
    (folder / "proposals.json").write_text("{}")
    one.propose(calls.append)
    assert len(calls) == 1


def test_weights_lie_between_both_ends(weights, drive, tmp_path):
    network, _ = load_bev(weights)
    with torch.no_grad():
        network.score_head[-1].bias += 2.0
    content = {"epoch": 0, "hyper_parameters": {"model": "bev", **CONFIG.metadata}}
    content["state_dict"] = {f"network.{name}": one for name, one in network.state_dict().items()}
    torch.save(content, tmp_path / "trained.ckpt")
    line = WeightLine(AdaptedBev(weights, open_drive(drive)), tmp_path / "trained.ckpt")
    maps = torch.from_numpy(
        random_maps((1, 32, 32, 16, CHANNELS), np.random.default_rng(1))["maps"]
    )
    with torch.no_grad():
        first, middle, last = (line.at(share).module(maps).scores for share in (0, 0.5, 1))
    assert torch.allclose(middle - first, torch.ones_like(first), atol=1e-4)
    assert torch.allclose(last - first, 2 * torch.ones_like(first), atol=1e-4)


def precision(gain, labels=10):
    return AdaptedPrecision(labels, 40.0, 40.0, 40.0, 40.0 + gain)


def test_weights_are_used_where_they_are_better_and_nothing_is_lost():
    report = AdaptationReport(
        "AP", {KEPT: {MEAN: precision(2.0, labels=50)}, "synthetic": {MEAN: precision(-0.9)}}, ["synthetic"], 1.0, 0.4
    )  # fmt: skip
    assert report.is_better
    lost = replace(report, max_lost=0.5)
    assert lost.reasons == ["synthetic loses 0.9"]
    same = replace(report, sets={**report.sets, KEPT: {MEAN: precision(0.0, labels=49)}})
    assert same.reasons == ["kept apart gains +0.0", "kept apart has 49 labels, 50 are needed"]
    few = [precision(3.0, labels=30), precision(-1.0, labels=10)]
    mean = AdaptedPrecision.mean(few)
    assert (mean.labels, mean.gain) == (40, pytest.approx(2.0))
    mean = AdaptedPrecision.mean([*few, precision(1.0, labels=50)])
    assert (mean.labels, mean.gain) == (50, pytest.approx(1.0))


def test_what_cannot_be_adapted_to_is_refused(drive, tmp_path):
    lidar = tmp_path / "training"
    shutil.copytree(drive, lidar, ignore=shutil.ignore_patterns("image_02"))
    with fault(
        UsageError, where="training", expected="a drive with images", advice="leave --network"
    ):
        command("adapt", lidar, "--out", tmp_path, "--network", "rgb")
    with fault(UsageError, where="drives", expected="one of each name"):
        open_adapted([drive, drive], None, "labels", tmp_path, images=False)
    synth_config = SynthConfig(layout="object", frames=1, sensor=VLP_16, seed=4, images=False)
    [frames] = write_drives(tmp_path / "object", synth_config)
    with fault(UsageError, expected="frames that follow each other", found="single frames"):
        open_adapted([frames], None, "labels", tmp_path, images=False)
    with fault(UsageError, where="--kept", expected="above 0, below 1"):
        AdaptationConfig(kept=1.0)
    with fault(UsageError, where="of", expected="before and after a gap of 2 s", advice="a longer drive"):  # fmt: skip
        command("adapt", drive, "--out", tmp_path / "short")
