"""A detector's checkpoint becomes a file that finds the same, in 8 bits where that is worth it."""

import json

import numpy as np
import onnx
import pytest
import torch

from data.open_drive import open_drive
from data.splits.training_frames import ENTRY
from export.detector import (
    best_int8,
    choose,
    exportable_detector,
    measure_variants,
    moderate,
    random_images,
)
from export.onnx import to_onnx
from export.result import ExportConfig
from export.variants import ModelVariant, compare, torch_runner
from perception.cli.main import main
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.errors import ImageError, ModelError, UsageError
from tests.car_frames import write_car_frames
from tests.detection.bright_cells import bright_cells
from tests.faults import command, fault
from train.networks.compact import CompactDetector

SIZE = InputSize(64, 96)
# Of a training on one frame, which no drive has.
PROVENANCE = {"split": "00ff00ff00ff00ff", "part": "train", ENTRY: "AAECAwQFBgc="}


def images(rows, seed=0, channels=1):
    return random_images(rows, (channels, *SIZE), np.random.default_rng(seed))


def checkpoint_of(modality="dm", classes="Car"):
    """Return what training writes, with scores all over the place."""
    torch.manual_seed(0)
    names = tuple(classes.split(","))
    channels = 3 if modality == "rgb" else 1
    network = CompactDetector(names, channels=channels)
    with torch.no_grad():
        for _ in range(10):
            network.train()(torch.from_numpy(images(8, channels=channels)))
        convolution = network.head.convolution
        convolution.weight *= 3
        convolution.bias.zero_()
    return {
        "epoch": 11,
        "hyper_parameters": {
            "model": "detector",
            "kind": "detector",
            "network": "compact",
            "modality": modality,
            "classes": classes,
            "input_height": str(SIZE.height_px),
            "input_width": str(SIZE.width_px),
            "filling": "default",
            "training_data": "two streets",
            "revision": "0123abc",
            **PROVENANCE,
        },
        "state_dict": {f"network.{name}": weight for name, weight in network.state_dict().items()},
    }


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    path = tmp_path_factory.mktemp("checkpoints") / "dm.ckpt"
    torch.save(checkpoint_of(), path)
    return path


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return write_car_frames(tmp_path_factory.mktemp("cars") / "object", frames=2)


@pytest.fixture(scope="module")
def exported(checkpoint, tmp_path_factory):
    """All that one command writes; chosen by its figures, which are of a network that learned nothing."""
    folder = tmp_path_factory.mktemp("split")
    frames, split = write_car_frames(folder / "object", frames=5), folder / "split.json"
    command("split", frames, "--shares", "60,40", "--out", split)
    out = tmp_path_factory.mktemp("exported") / "dm.onnx"
    words = ("export", checkpoint, "--out", out, "--data", frames, "--split", split)
    command(*words, "--int8", "true")
    return out


def file_of(exported, variant):
    """Return the file in full precision or in 8 bits, whichever was chosen."""
    beside = exported.with_suffix(f".{variant}.onnx")
    return beside if beside.exists() else exported


def test_file_finds_what_the_checkpoint_finds(checkpoint, exported):
    exportable = exportable_detector(checkpoint)
    model = ModalityDetector(file_of(exported, "fp32")).model
    batches = [{"images": images(rows, seed=7)} for rows in (1, 4)]
    parity = compare(torch_runner(exportable), model, batches)
    assert parity.rows == 5
    assert parity.largest["scores"] < 1e-5
    assert parity.largest["boxes_px"] < 0.01
    assert model(batches[1])["scores"].std() > 0.05  # else all of this shows nothing


def test_8_bits_are_near_to_it(exported):
    full, int8_name = (
        ModalityDetector(file_of(exported, variant)).model for variant in ("fp32", "int8")
    )
    batch = {"images": images(2, seed=7)}
    difference = np.abs(full(batch)["scores"] - int8_name(batch)["scores"])
    assert 0 < difference.mean() < 0.05


def test_all_layers_between_the_outer_convolutions_compute_in_integers(exported):
    nodes = list(onnx.load(file_of(exported, "int8")).graph.node)
    maker = {output: node for node in nodes for output in node.output}
    places = [place for place, node in enumerate(nodes) if node.op_type == "Conv"]
    for place in (places[0], places[-1]):
        assert nodes[place].input[1] not in maker  # weights as they are
    between = nodes[places[0] + 1 : places[-1]]
    working = [node for node in between if node.op_type in ("Conv", "Add", "Resize")]
    assert len(working) > 20
    for node in working:
        assert maker[node.input[0]].op_type == "DequantizeLinear"


def test_detector_opens_what_was_written(exported):
    detector = ModalityDetector(exported)
    assert (detector.modality, detector.size, detector.filling) == ("dm", SIZE, "default")
    assert detector.metadata["training_data"] == "two streets"
    assert detector.metadata["epochs"] == "12"
    found = detector.detect(np.random.default_rng(0).integers(0, 256, (190, 620, 1), np.uint8))
    assert ((found.boxes_px >= 0) & (found.boxes_px <= [619, 189, 619, 189])).all()


def test_report_says_what_was_tried_and_chosen(exported):
    report = json.loads(exported.with_suffix(".json").read_text())
    int8_name = ["int8 minmax", "int8 percentile"]
    assert list(report["variants"]) == ["torch", "fp32", *int8_name]
    assert set(report["variants"]["fp32"]["precision"]) == {"Car 0.7", "Car 0.5"}
    assert report["variants"]["fp32"]["parity"]["images"]["rows"] == 2
    assert (
        report["variants"][int8_name[0]]["size_bytes"]
        < 0.3 * report["variants"]["fp32"]["size_bytes"]
    )
    assert report["choice"]["variant"] in ("fp32", int8_name[0])
    assert report["frames"] == 2
    written = sorted(path.name for path in exported.parent.iterdir())
    other = "fp32" if report["choice"]["variant"] != "fp32" else "int8"
    assert written == sorted(["dm.json", "dm.onnx", f"dm.{other}.onnx"])


def test_compression_of_the_training_images_reaches_the_file(tmp_path):
    content = checkpoint_of()
    content["hyper_parameters"]["jpeg_quality"] = "75"
    torch.save(content, tmp_path / "compressed.ckpt")
    assert exportable_detector(tmp_path / "compressed.ckpt").metadata["jpeg_quality"] == "75"


@pytest.mark.parametrize("variant", ["fp32", "int8"])
def test_every_file_states_what_the_network_learned_from(exported, variant):
    metadata = ModalityDetector(file_of(exported, variant)).metadata
    assert {name: metadata[name] for name in PROVENANCE} == PROVENANCE
    report = json.loads(exported.with_suffix(".json").read_text())
    assert (report["metadata"]["split"], report["frames"]) == (PROVENANCE["split"], 2)
    assert ENTRY not in report["metadata"]  # one hash of each frame


def test_a_part_needs_a_split_and_a_split_needs_a_drive(checkpoint, tmp_path):
    words = ("export", checkpoint, "--out", tmp_path / "dm.onnx")
    with fault(UsageError, "--part test", "--split FILE beside it"):
        command(*words, "--part", "test")
    with fault(UsageError, "--split", "--data DRIVE beside it"):
        command(*words, "--split", tmp_path / "split.json")


def test_file_in_8_bits_says_so(exported):
    assert ModalityDetector(file_of(exported, "int8")).metadata["form"] == "int8 minmax"


def variant(ms, ap=None):
    levels = {"easy": 90.0, "moderate": ap, "hard": 10.0}
    precision = {} if ap is None else {"Car 0.7": levels, "Car 0.5": {**levels, "moderate": 99.0}}
    return ModelVariant(1000, ms, {}, precision)


@pytest.mark.parametrize(
    ("full", "int8_name", "chosen", "reason"),
    [
        (variant(20, 60.0), variant(7, 59.2), "int8 percentile", "loses 0.80 points"),
        (variant(20, 60.0), variant(7, 58.8), "fp32", "loses 1.20 points"),
        (variant(20, 60.0), variant(7, 61.0), "int8 percentile", "loses -1.00 points"),
        (variant(20, 60.0), variant(20, 60.0), "fp32", "is no faster: 20.0 ms beside 20.0 ms"),
        (variant(20), variant(7), "fp32", "no labels tell what int8 percentile loses"),
    ],
)
def test_8_bits_are_chosen_where_they_are_faster_and_see_as_well(full, int8_name, chosen, reason):
    choice = choose({"fp32": full, "int8 percentile": int8_name}, "int8 percentile")
    assert choice.variant == chosen
    assert reason in choice.reason


def test_full_precision_without_8_bits():
    assert choose({"fp32": variant(20)}, None).variant == "fp32"


def test_best_scales_are_those_that_see_best():
    variants = {"fp32": variant(20, 60.0), "int8 a": variant(7, 50.0), "int8 b": variant(9, 59.0)}
    assert moderate(variants["int8 b"]) == 59.0
    assert best_int8(variants) == "int8 b"
    assert (
        best_int8({"fp32": variant(20, 60.0), "int8 a": variant(7), "int8 b": variant(7)})
        == "int8 a"
    )
    assert best_int8({"fp32": variant(20)}) is None


def test_precision_is_that_of_the_labelled_frames(drive, tmp_path):
    (tmp_path / "dm.onnx").write_bytes(bright_cells("dm"))
    detector = ModalityDetector(tmp_path / "dm.onnx")
    opened = open_drive(drive)
    scale = 96 / 620  # letterboxed by the longer side
    labels = iter([opened.labels(0), opened.labels(1)])

    def seer(inputs):
        boxes_px = next(labels).boxes_px * scale
        return {"boxes_px": boxes_px[None], "scores": np.full((1, len(boxes_px), 1), 0.9)}

    def blind(inputs):
        assert inputs["images"].shape == (1, 1, 64, 96)
        return {"boxes_px": np.zeros((1, 1, 4)), "scores": np.zeros((1, 1, 1))}

    config = ExportConfig(tmp_path / "any.ckpt", opened)
    found = measure_variants(config, {"fp32": seer, "int8": blind}, detector)
    # Every car was found: as much as four cars with one score can reach at 40 recalls.
    assert found["fp32"]["Car 0.7"]["moderate"] == pytest.approx(5.0)
    assert found["int8"]["Car 0.7"]["moderate"] == 0.0
    assert measure_variants(ExportConfig(tmp_path / "any.ckpt"), {"fp32": blind}, detector) == {}


def test_a_file_takes_images_of_any_size(checkpoint, tmp_path):
    exportable = exportable_detector(checkpoint)
    file = tmp_path / "dm.onnx"
    file.write_bytes(to_onnx(exportable))
    network = ModalityDetector(file).model
    for size in ((32, 32), (96, 64), (160, 32)):
        batch = {"images": random_images(3, (1, *size), np.random.default_rng(1))}
        expected = torch_runner(exportable)(batch)
        for name, found in network(batch).items():
            np.testing.assert_allclose(found, expected[name], atol=0.01)


def test_another_size_is_a_file_of_that_size(checkpoint, exported):
    exportable = exportable_detector(checkpoint, InputSize(32, 160))
    assert exportable.inputs["images"].shape == (2, 1, 32, 160)
    assert exportable.metadata["input_height"] == "32"
    assert exportable.metadata["input_width"] == "160"
    boxes_px, scores = exportable.module(exportable.inputs["images"])
    assert boxes_px.shape == (2, 4 * 20 * 5, 4)
    assert scores.shape == (2, 4 * 20 * 5, 1)
    usual = exportable_detector(checkpoint)
    assert usual.metadata["anchors"] == exportable.metadata["anchors"]


def test_frames_are_spread_over_the_drive(drive, tmp_path):
    opened = open_drive(write_car_frames(tmp_path / "more", frames=5))
    config = ExportConfig(tmp_path / "any.ckpt", opened, frames=3)
    assert [frame.index for frame in config.read("test")] == [0, 2, 4]
    assert [frame.index for frame in config.read("test", most=2)] == [0, 4]


@pytest.fixture
def from_file(exported, monkeypatch):
    """Skip what is slow and tested above: torch's exporter."""
    data = file_of(exported, "fp32").read_bytes()
    monkeypatch.setattr("export.detector.to_onnx", lambda exportable: data)


def test_without_8_bits_one_file_is_written(checkpoint, from_file, tmp_path, capsys):
    out = tmp_path / "dm.onnx"
    assert main(["export", str(checkpoint), "--out", str(out)]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dm.json", "dm.onnx"]
    assert "chosen: fp32; no other form was asked for" in capsys.readouterr().out


def test_difference_beyond_tolerance_leaves_a_report_and_no_file(
    checkpoint, from_file, tmp_path, monkeypatch
):
    monkeypatch.setattr("export.detector.TOLERANCES", {"scores": -1.0, "boxes_px": 1.0})
    with fault(ModelError, "dm.onnx", "scores within -1 of the checkpoint's"):
        command("export", checkpoint, "--out", tmp_path / "dm.onnx")
    assert [path.name for path in tmp_path.iterdir()] == ["dm.json"]


@pytest.mark.parametrize("size", ["190x640", "wide"])
def test_size_that_no_network_takes(checkpoint, tmp_path, size):
    with fault(UsageError, expected="multiples of 32 pixels", found=size):
        command("export", checkpoint, "--out", tmp_path / "dm.onnx", "--size", size)


def test_8_bits_need_a_drive(checkpoint, tmp_path):
    with fault(UsageError, "--int8", "--data", "none"):
        command("export", checkpoint, "--out", tmp_path / "dm.onnx", "--int8")


def test_camera_detector_needs_a_drive_with_images(drive, tmp_path, monkeypatch):
    torch.save(checkpoint_of("rgb"), tmp_path / "rgb.ckpt")
    (tmp_path / "stand_in.onnx").write_bytes(bright_cells("rgb", size=SIZE))
    data = (tmp_path / "stand_in.onnx").read_bytes()
    monkeypatch.setattr("export.detector.to_onnx", lambda exportable: data)
    with fault(ImageError, expected="a camera image", found="none"):
        command("export", tmp_path / "rgb.ckpt", "--out", tmp_path / "rgb.onnx", "--data", drive)


def test_network_that_yields_nan_is_not_exported(checkpoint, tmp_path, monkeypatch):
    data = bright_cells("dm", divisor=0.0)
    monkeypatch.setattr("export.detector.to_onnx", lambda exportable: data)
    with fault(ModelError, expected="finite numbers in output scores"):
        command("export", checkpoint, "--out", tmp_path / "dm.onnx")
    assert list(tmp_path.iterdir()) == []
