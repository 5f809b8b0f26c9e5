"""Studies that train detectors: what differs, what is not done twice, and what the tables say."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.studies import detector_variants
from benchmarks.studies.detector_losses import loss_variants
from benchmarks.studies.detector_variants import (
    DetectorVariant,
    VariantFlags,
    VariantMetrics,
    study_variants,
)
from benchmarks.studies.reflectance_maps import THESIS_B2, THESIS_B3, map_variants
from benchmarks.studies.sim_to_real import (
    ALL,
    UNCHANGED,
    leave_out_variants,
    loss_tables,
    share_variants,
)
from benchmarks.studies.variant_report import precision_tables, times_table, variant_panels
from data.results.documents import write_json
from export import onnx
from perception.cli.main import main
from perception.errors import UsageError
from tests.detection.bright_cells import bright_cells
from tests.faults import command, fault
from tests.train.toy_images import tiny_network
from train.detector import networks

BASE = DetectorVariant(
    {
        "data.drives": [Path("streets")],
        "model.modality": "rm",
        "model.network": "tiny",
        "model.size": "64x96",
        "trainer.max_epochs": 4,
    }
)


@pytest.fixture
def trainings(monkeypatch):
    """Put a training that does nothing in place; return what it was asked for."""
    asked = []

    def fit(kind, arguments, out, progress, config):
        asked.append(arguments)
        write_json(out / "metrics.json", {"epoch": 3, "counts": {"training_frames": 7}})

    def write(folder):
        file = folder / "detector.onnx"
        file.write_bytes(bright_cells("dm", size=(64, 96)))
        return file

    monkeypatch.setattr("train.cli.fit", fit)
    monkeypatch.setattr(detector_variants, "_model_file", write)
    return asked


def flags_of(*validation, **changes):
    return VariantFlags(list(validation), **changes)


def test_what_is_done_is_not_done_again(car_frames, trainings, tmp_path):
    variants = {"base": BASE, "wide": BASE.but(model__size="64x128")}
    first = study_variants(variants, flags_of(car_frames), tmp_path / "out")
    assert [one["model.size"] for one in trainings] == ["64x96", "64x128"]
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


def test_no_validation_drive_is_an_error():
    with fault(UsageError, where="--validation", expected="at least one drive", found="none"):
        flags_of()


def test_maps_differ_in_filling_and_size_alone():
    variants = map_variants(BASE, "64x128")
    assert {name: one.arguments["model.filling"] for name, one in variants.items()} == {
        "sparse": "sparse",
        "nearest": "nearest",
        "linear": "linear",
        "natural": "natural",
        "Trifuse": "default",
        "nearest, wide": "nearest",
    }
    sizes = {name: one.arguments["model.size"] for name, one in variants.items()}
    assert {name for name, size in sizes.items() if size == "64x128"} == {"nearest, wide"}
    assert {*THESIS_B2, *THESIS_B3} <= set(variants)


def test_losses_are_all_four():
    forms = {
        name: (one.arguments["model.loss.box"], one.arguments["model.loss.objectness"])
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
    names = ("data.training_fraction", "trainer.max_epochs", "data.augment")
    settings = [tuple(one.arguments.get(name) for name in names) for one in variants.values()]
    assert settings == [(0.25, 16, None), (1.0, 4, None), (None, 4, False)]
    assert list(variants)[-1] == UNCHANGED
    with fault(UsageError, where="--shares", expected="shares above 0, at most 1", found="2"):
        share_variants(BASE, (2.0,))


def test_each_drive_is_left_out_once_for_about_as_many_steps(car_frames, tmp_path):
    copy = tmp_path / "copy"
    copy.symlink_to(car_frames, target_is_directory=True)
    variants = leave_out_variants(BASE, [car_frames, copy])
    settings = {
        name: (one.arguments.get("data.drives"), one.arguments["trainer.max_epochs"])
        for name, one in variants.items()
    }
    assert settings == {
        ALL: ([Path("streets")], 4),
        f"without {car_frames.name}": ([copy], 8),
        "without copy": ([car_frames], 8),
    }
    # A share of 1 is the same training.
    assert variants[ALL] == share_variants(BASE, (1.0,))[ALL]
    with fault(UsageError, where="--leave-one-out", expected="two training drives or more"):
        leave_out_variants(BASE, [car_frames])


def test_the_loss_is_that_against_all_drives():
    metrics = {ALL: metrics_of(60.0), "without a": metrics_of(45.0), "without b": metrics_of(62.0)}
    (table,) = loss_tables(metrics).values()
    assert table.to_json()["without a"] == {
        "frames": 5,
        "AP, IoU 0.7": 45.0,
        "loss, IoU 0.7": 15.0,
        "AP, IoU 0.5": 45.0,
        "loss, IoU 0.5": 15.0,
    }
    assert table.to_json()["without b"]["loss, IoU 0.7"] == -2.0


def test_left_out_drives_are_curves_of_every_measured_drive():
    panels = variant_panels({ALL: metrics_of(60.0), "without a": metrics_of(45.0)}, 0.5)
    (panel,) = panels
    assert [curve.name for curve in panel.curves] == [ALL, "without a"]


def metrics_of(ap, interval=None):
    found = {"ap_r40_percent": ap, "curve": {"precision": [1.0] * 41}}
    if interval is not None:
        found["ap_r40_low_percent"], found["ap_r40_high_percent"] = interval
    levels = {"easy": found, "moderate": found, "hard": {"ap_r40_percent": None}}
    drives = {"val": {"data": "synthetic", "frames": 9, "iou": {"0.7": levels, "0.5": levels}}}
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
    network, photographed = tmp_path / "public.onnx", tmp_path / "photographed"
    network.write_bytes(bright_cells("rgb", size=(64, 96)))
    shutil.copytree(car_frames, photographed)
    for scan in (photographed / "training/velodyne").glob("*.bin"):
        file = photographed / "training/image_2" / f"{scan.stem}.png"
        file.parent.mkdir(exist_ok=True)
        cv2.imwrite(str(file), np.zeros((375, 1242, 3), np.uint8))
    words[2] = str(photographed)
    public = ["--shares", "", "--public", str(network)]
    assert main(["study", "sim-to-real", *words, *public]) == 0
    assert len(trainings) == 9
    document = json.loads(out.with_suffix(".json").read_text())
    assert document["results"]["realism"]["public"][str(photographed)]["Car"]["0 to 15 m"]
    assert main(["study", "reflectance-maps", *words[:-1], "0"]) == 2


def model_of(metadata):
    assert (metadata["modality"], metadata["filling"], metadata["epochs"]) == ("rm", "default", "1")
    return bright_cells("rm", size=(64, 96))


def test_a_tiny_training_from_frames_to_figures(car_frames, tmp_path, monkeypatch):
    monkeypatch.setitem(networks.NETWORKS, "tiny", tiny_network)
    # To write a model file takes ten times as long as the rest; tests/export have that.
    monkeypatch.setattr(onnx, "to_onnx", lambda exportable: model_of(exportable.metadata))
    variant = DetectorVariant(
        {
            **BASE.arguments,
            "data.drives": [car_frames],
            "data.validation": [car_frames],
            "data.batch_size": 2,
            "data.cache": tmp_path / "cache",
            "trainer.max_epochs": 1,
            "trainer.accelerator": "cpu",
        }
    )
    flags = flags_of(car_frames)
    found = study_variants({"base": variant}, flags, tmp_path / "out")
    assert (found["base"].epoch, found["base"].training_frames) == (1, 3)
    assert found["base"].network_ms > 0
    folder = tmp_path / "out/base"
    assert {"best.ckpt", "config.yaml", "detector.onnx", "measured.json", "metrics.json"} <= {
        file.name for file in folder.iterdir()
    }


def test_depthcn_is_trained_without_and_with_augmentation(tmp_path, monkeypatch):
    asked = []

    def fit(kind, arguments, out, progress, config):
        asked.append((arguments["data.augment"], arguments["trainer.max_epochs"]))
        values = {"crops": 8, "accuracy": 0.75, "balanced_accuracy": 0.5}
        parts = {"training": values, "validation": {**values, "crops": 4}}
        metrics = {"checkpoint": out / "best.ckpt", "epoch": 2, "parts": parts}
        write_json(out / "metrics.json", metrics)

    monkeypatch.setattr("train.cli.fit", fit)
    monkeypatch.setattr(
        "train.events.read_scalars", lambda _, names: dict.fromkeys(names, np.array([0.5, 0.75]))
    )
    out = tmp_path / "augmentation.png"
    command("study", "augmentation", "streets", "--epochs", 2, "--out", out)
    assert asked == [(False, 2), (True, 2)]
    rows = json.loads(out.with_suffix(".json").read_text())["results"]["accuracy"]
    assert rows["with augmentation"]["validation"] == 75
    assert rows["without augmentation"]["thesis validation"] == 86.69
    command("study", "augmentation", "streets", "--out", out)  # both are done
    assert len(asked) == 2
