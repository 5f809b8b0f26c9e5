"""Studies that train detectors: what differs, what is not done twice, and what the tables say."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from train.verifier.run import TrainedVerifier

from benchmarks.studies import detector_variants
from benchmarks.studies.detector_losses import loss_variants
from benchmarks.studies.detector_variants import (
    DetectorVariant,
    VariantFlags,
    VariantMetrics,
    study_variants,
)
from benchmarks.studies.reflectance_maps import THESIS_B2, THESIS_B3, map_variants
from benchmarks.studies.sim_to_real import UNCHANGED, share_variants
from benchmarks.studies.variant_report import precision_tables, times_table
from data.samples.config import TrainingDrives
from data.samples.images.config import ImageDataConfig
from export import onnx
from perception.cli.main import main
from perception.errors import UsageError
from tests.detection.bright_cells import bright_cells
from tests.faults import command, fault
from tests.train.toy_images import tiny_network
from train.config import TrainingRun
from train.detector import networks
from train.detector.config import DetectorExperiment, DetectorModelConfig

BASE = DetectorVariant(
    DetectorExperiment(
        TrainingDrives((Path("streets"),)), "rm", DetectorModelConfig("tiny", size="64x96")
    ),
    TrainingRun(epochs=4),
)


@dataclass(frozen=True)
class Trained:
    epoch: int
    counts: dict


@pytest.fixture
def trainings(monkeypatch):
    """Put a training that does nothing in place; return what it was asked for."""
    asked = []

    def train(experiment, run, folder, progress):
        asked.append((experiment, run.epochs, folder.resume and folder.resume.name))
        folder.on_start()
        folder.last.touch()
        return Trained(3, {"training_frames": 7})

    def write(folder):
        file = folder / "detector.onnx"
        file.write_bytes(bright_cells("dm", size=(64, 96)))
        return file

    monkeypatch.setattr("train.detector.run.run_experiment", train)
    monkeypatch.setattr(detector_variants, "_model_file", write)
    return asked


def with_model(**changes):
    model = replace(BASE.experiment.model, **changes)
    return replace(BASE, experiment=replace(BASE.experiment, model=model))


def flags_of(*validation, **changes):
    return VariantFlags(list(validation), **changes)


def test_what_is_done_is_not_done_again(car_frames, trainings, tmp_path):
    variants = {"base": BASE, "wide": with_model(size="64x128")}
    first = study_variants(variants, flags_of(car_frames), tmp_path / "out")
    assert [experiment.model.size for experiment, *_ in trainings] == ["64x96", "64x128"]
    assert list(first) == ["base", "wide"]
    assert (first["base"].epoch, first["base"].training_frames) == (3, 7)
    assert first["base"].drives[str(car_frames)]["frames"] == 3
    assert first["base"].maps_ms > 0
    again = study_variants(variants, flags_of(car_frames), tmp_path / "out")
    assert again == first
    assert len(trainings) == 2


def test_other_drives_are_measured_without_training_again(car_frames, trainings, tmp_path):
    flags, others = flags_of(car_frames), [car_frames / "training"]
    study_variants({"base": BASE}, flags, tmp_path / "out")
    metrics = study_variants({"base": BASE}, flags, tmp_path / "out", others)
    assert list(metrics["base"].drives) == [str(car_frames), str(car_frames / "training")]
    assert len(trainings) == 1


def test_a_stopped_training_is_resumed(car_frames, trainings, tmp_path):
    out = tmp_path / "out"
    study_variants({"base": BASE}, flags_of(car_frames), out)
    (out / "base/trained.json").unlink()
    study_variants({"base": BASE}, flags_of(car_frames), out)
    assert [resume for *_, resume in trainings] == [None, "last.ckpt"]


def test_a_folder_of_other_settings_is_an_error(car_frames, trainings, tmp_path):
    study_variants({"base": BASE}, flags_of(car_frames), tmp_path)
    with fault(UsageError, where="base", expected="a training with the same settings"):
        other = replace(BASE, run=replace(BASE.run, seed=1))
        study_variants({"base": other}, flags_of(car_frames), tmp_path)
    with fault(UsageError, where="--validation", expected="at least one drive", found="none"):
        flags_of()


def test_a_training_that_is_refused_leaves_no_settings(car_frames, tmp_path, monkeypatch):
    def refuse(*_):
        raise UsageError("network", expected="a known one", found="tiny")

    monkeypatch.setattr("train.detector.run.run_experiment", refuse)
    with fault(UsageError, where="network"):
        study_variants({"base": BASE}, flags_of(car_frames), tmp_path)
    assert not (tmp_path / "base/settings.json").exists()


def test_maps_differ_in_filling_and_size_alone():
    variants = map_variants(BASE, "64x128")
    assert {name: one.experiment.model.filling for name, one in variants.items()} == {
        "sparse": "sparse",
        "nearest": "nearest",
        "linear": "linear",
        "natural": "natural",
        "Trifuse": "default",
        "nearest, wide": "nearest",
    }
    sizes = {name: one.experiment.model.size for name, one in variants.items()}
    assert {name for name, size in sizes.items() if size == "64x128"} == {"nearest, wide"}
    assert {*THESIS_B2, *THESIS_B3} <= set(variants)


def test_losses_are_all_four():
    forms = {
        name: (one.experiment.loss.box, one.experiment.loss.objectness)
        for name, one in loss_variants(BASE).items()
    }
    assert forms == {
        "as published": ("squared", "squared"),
        "focal objectness": ("squared", "focal"),
        "CIoU of boxes": ("ciou", "squared"),
        "both": ("ciou", "focal"),
    }


def test_shares_are_trained_for_as_many_steps():
    variants = share_variants(BASE, (0.25, 1.0))
    settings = [
        (one.experiment.data.training_fraction, one.run.epochs, one.experiment.data.augment)
        for one in variants.values()
    ]
    assert settings == [(0.25, 16, True), (1.0, 4, True), (1.0, 4, False)]
    assert list(variants)[-1] == UNCHANGED
    with fault(UsageError, where="--shares", expected="shares above 0, at most 1", found="2"):
        share_variants(BASE, (2.0,))


def metrics_of(ap, interval=None):
    found = {"ap_r40_percent": ap, "curve": {"precision": [1.0] * 41}}
    if interval is not None:
        found["ap_r40_low_percent"], found["ap_r40_high_percent"] = interval
    levels = {"easy": found, "moderate": found, "hard": {"ap_r40_percent": None}}
    drives = {"val": {"data": "synthetic", "frames": 9, "iou": {"0.7": levels}}}
    return VariantMetrics(2, 5, 1.5, 20.25, drives)


def test_tables_stand_beside_the_thesis():
    metrics = {"sparse": metrics_of(20.0, (15, 25)), "Trifuse": metrics_of(60.0)}
    tables = precision_tables("Maps", metrics, [0.7], THESIS_B2)
    (table,) = tables.values()
    lines = [" ".join(line.split()) for line in table.text().splitlines()]
    assert lines[0] == "Maps: AP R40 [%] on val, IoU over 0.7"
    sparse = "20.00 15.0 to 25.0 23.45 20.00 15.0 to 25.0 17.57 0.00 15.57"
    assert lines[3] == f"sparse synthetic 5 2 {sparse}"
    assert lines[4] == "Trifuse synthetic 5 2 60.00 - - 60.00 - - 0.00 -"
    assert table.to_json()["sparse"]["moderate"] == 20.0
    times = times_table("Times", metrics, (34, 15)).to_json()
    assert times["sparse"] == {"map [ms]": 1.5, "network [ms]": 20.25}
    assert times["thesis"] == {"map [ms]": 34, "network [ms]": 15}


def test_the_command_prints_tables_and_draws(car_frames, trainings, tmp_path, capsys):
    out = tmp_path / "study.png"
    words = [str(car_frames), "--validation", str(car_frames), "--out", str(out), "--epochs", "2"]
    assert main(["study", "reflectance-maps", *words]) == 0
    printed = capsys.readouterr().out
    for title in ("Table B.1", "Table B.2", "Table B.3"):
        assert title in printed
    assert len(trainings) == 6
    assert out.stat().st_size > 10_000
    document = json.loads(out.with_suffix(".json").read_text())
    assert list(document["results"]["variants"]) == list(map_variants(BASE, ""))
    assert (
        main(["study", "sim-to-real", *words, "--shares", "0.5,1", "--real", str(car_frames)]) == 0
    )
    assert len(trainings) == 9
    assert main(["study", "reflectance-maps", *words[:-1], "0"]) == 2


def model_of(metadata):
    assert (metadata["modality"], metadata["filling"], metadata["epochs"]) == ("rm", "default", "1")
    return bright_cells("rm", size=(64, 96))


def test_a_tiny_training_from_frames_to_figures(car_frames, tmp_path, monkeypatch):
    monkeypatch.setitem(networks.NETWORKS, "tiny", tiny_network)
    # To write a model file takes ten times as long as the rest; tests/export have that.
    monkeypatch.setattr(onnx, "to_onnx", lambda exportable: model_of(exportable.metadata))
    experiment = replace(
        BASE.experiment,
        drives=TrainingDrives((car_frames,), (car_frames,)),
        data=ImageDataConfig(batch_size=2, cache=tmp_path / "cache"),
    )
    variant = replace(BASE, experiment=experiment, run=TrainingRun(epochs=1, accelerator="cpu"))
    flags = flags_of(car_frames)
    found = study_variants({"base": variant}, flags, tmp_path / "out")
    assert (found["base"].epoch, found["base"].training_frames) == (1, 3)
    assert found["base"].network_ms > 0
    folder = tmp_path / "out/base"
    assert {"best.ckpt", "detector.onnx", "settings.json", "trained.json", "metrics.json"} <= {
        file.name for file in folder.iterdir()
    }


def test_depthcn_is_trained_without_and_with_augmentation(tmp_path, monkeypatch):
    asked = []

    def train(experiment, run, folder, progress):
        asked.append((experiment.data.augment, run.epochs))
        folder.out.mkdir(parents=True)
        folder.last.touch()
        counts = {"training_crops": 8, "validation_crops": 4}
        metrics = {"accuracy": 0.75, "balanced_accuracy": 0.5}
        return TrainedVerifier(folder.best, 2, counts, metrics, metrics)

    monkeypatch.setattr("train.verifier.run.run_experiment", train)
    monkeypatch.setattr(
        "train.events.read_scalars", lambda _, names: dict.fromkeys(names, np.array([0.5, 0.75]))
    )
    out = tmp_path / "augmentation.png"
    command("study", "augmentation", "streets", "--epochs", 2, "--out", out)
    assert asked == [(False, 2), (True, 2)]
    rows = json.loads(out.with_suffix(".json").read_text())["results"]["accuracy"]
    assert rows["with augmentation"]["validation"] == 75
    assert rows["without augmentation"]["thesis validation"] == 86.69
    with fault(UsageError, where="without", found="last.ckpt", advice="--resume last"):
        command("study", "augmentation", "streets", "--out", out)
