"""`trifuse evaluate detection`: tables, plots, JSON documents and images of each kind of detector."""

import json
import shutil
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from data.detections import measured_detectors, measured_drives
from data.detections.compared_detectors import open_compared
from data.detections.measured_detectors import DetectorOptions, open_detector
from data.open_drive import open_drive
from perception.cli.main import main
from perception.detection.config import DetectionConfig
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.nms_fusion import NmsFusion
from perception.errors import DriveError, ModelError, ScanError, UsageError
from perception.evaluation.detection.config import PrecisionConfig
from perception.types import MODALITIES, Detections
from tests.car_frames import write_car_frames
from tests.detection.bright_cells import bright_cells
from tests.detection.fusion.conftest import AS_IT_WAS, weighted_sums
from tests.faults import command, fault


def evaluate(*words: str | Path) -> int:
    return main(["evaluate", "detection", *map(str, words)])


def rows_of(printed: str, drive: Path | str, title: str) -> dict[str, list[str]]:
    """Return the cells of the table of a drive with a title, by the name of the row."""
    lines = printed.splitlines()
    start = next(
        number
        for number, line in enumerate(lines)
        if line.startswith(f"{drive} (") and title in line
    )
    table = lines[start + 3 :]
    end = table.index("") if "" in table else len(table)
    rows = {}
    for line in table[:end]:
        name, _, cells = line.partition("  ")
        rows[name] = cells.split()
    return rows


# DepthCN


def test_depthcn_table_plot_and_document_agree(car_frames, label_reader, tmp_path, capsys):
    label_reader(car_frames)
    plot, out = tmp_path / "precision.png", tmp_path / "metrics.json"
    words = ("--detector", "depthcn", "--bootstrap", "20", "--plot", plot, "--json", out)
    assert evaluate(car_frames, *words) == 0
    printed = capsys.readouterr().out
    # Six cars are found and nothing else with such a score: the maximum for so few.
    row = rows_of(printed, car_frames, "average precision of DepthCN")["Car moderate 0.7"]
    assert row == ["6", "100.0", "6", "100.0", "12.50", "12.50", "12.50", "12.5"]
    assert "37.59 %" in printed
    assert "p50 3.0 ms/frame" in printed
    assert "2.0 proposals/frame" in printed
    document = json.loads(out.read_text())
    assert document["data"][0]["frames_evaluated"] == 3
    assert document["data"][0]["kind"] == "real"
    assert document["split"] == "depthcn was trained on: nothing at all"
    drive = document["results"][str(car_frames)]
    assert (drive["kind"], drive["frames"], drive["proposals_per_frame"]) == ("real", 3, 2.0)
    hard = drive["classes"]["Car"]["0.5"]["hard"]
    assert (hard["objects"], hard["proposal_recall_percent"]) == (6, 100.0)
    assert hard["ap_r40_percent"] == hard["max_ap_r40_percent"] == 12.5
    assert (hard["ap_r40_low_percent"], hard["ap_r40_high_percent"]) == (12.5, 12.5)
    assert len(hard["curve"]["precision"]) == 41
    assert plot.stat().st_size > 10_000


def test_one_iou_over_eleven_points(car_frames, label_reader, capsys):
    label_reader(car_frames)
    words = ("--detector", "depthcn", "--iou", "0.9", "--recall-points", "11", "--frames", "2")
    words += ("--bootstrap", "0")
    assert evaluate(car_frames, *words) == 0
    printed = capsys.readouterr().out
    assert "AP R11 [%]" in printed
    assert "95 %" not in printed
    # Of four cars, one point of the eleven: recall 0 to 0.075.
    rows = rows_of(printed, car_frames, "DepthCN")
    assert rows["Car hard 0.9"] == ["4", "100.0", "4", "100.0", "9.09", "9.1"]


def test_every_drive_has_its_own_table(car_frames, label_reader, tmp_path, capsys):
    label_reader(car_frames)
    street = write_car_frames(tmp_path / "street", frames=1)
    # Only synthetic frames have the class of every point.
    points = (street / "training/velodyne/000000.bin").stat().st_size // 16
    (street / "training/labels").mkdir()
    (street / "training/labels/000000.label").write_bytes(bytes(4 * points))
    assert evaluate(car_frames, street, "--detector", "depthcn", "--iou", "0.5") == 0
    printed = capsys.readouterr().out
    assert f"{car_frames} (real, 3 frames): average precision" in printed
    assert f"{street} (synthetic, 1 frames): average precision" in printed


def test_levels_of_tracking_labels_are_truncation(label_reader, tmp_path, capsys):
    objects = write_car_frames(tmp_path / "objects", frames=1) / "training"
    tracking = tmp_path / "tracking/training"
    for name in ("velodyne/0000", "calib", "label_02"):
        (tracking / name).mkdir(parents=True)
    (objects / "velodyne/000000.bin").rename(tracking / "velodyne/0000/000000.bin")
    (objects / "calib/000000.txt").rename(tracking / "calib/0000.txt")
    car = "0 {} Car {} 0 -1.57 {}.00 150 {}.00 200 1.5 1.6 3.9 0 1.5 20 -1.57"
    rows = [car.format(level, level, 100 + 200 * level, 200 + 200 * level) for level in (0, 1, 2)]
    (tracking / "label_02/0000.txt").write_text("\n".join(rows))
    label_reader(tracking)
    assert evaluate(tracking, "--detector", "depthcn") == 0
    rows = rows_of(capsys.readouterr().out, f"{tracking} 0000", "DepthCN")
    for difficulty in ("easy", "moderate", "hard"):
        assert rows[f"Car {difficulty} 0.7"][0] == "1"


def test_labels_without_objects(car_frames, label_reader, capsys):
    for file in (car_frames / "training/label_2").iterdir():
        file.write_text("DontCare -1 -1 -10 10 20 30 40 -1 -1 -1 -1000 -1000 -1000 -10\n")
    label_reader(car_frames)
    assert evaluate(car_frames, "--detector", "depthcn", "--bootstrap", "5") == 0
    row = rows_of(capsys.readouterr().out, car_frames, "DepthCN")["Car easy 0.7"]
    assert row == ["0", "0", "-", "-", "-"]


def test_a_drive_without_labels_is_an_error(car_frames, label_reader):
    label_reader(car_frames)
    shutil.rmtree(car_frames / "training/label_2")
    with fault(DriveError, expected="labelled boxes"):
        command("evaluate", "detection", car_frames, "--detector", "depthcn")


def test_bad_frames_stop_or_are_skipped(car_frames, label_reader, capsys):
    label_reader(car_frames)
    scans = sorted((car_frames / "training/velodyne").iterdir())
    scans[1].write_bytes(b"")
    with fault(ScanError, where="000002.bin"):
        command("evaluate", "detection", car_frames, "--detector", "depthcn")
    assert evaluate(car_frames, "--detector", "depthcn", "--on-bad-frame", "skip") == 0
    assert f"{car_frames} (real, 2 frames)" in capsys.readouterr().out
    for scan in scans:
        scan.write_bytes(b"")
    with fault(DriveError, expected="a frame that can be read", found="none"):
        command(
            "evaluate", "detection", car_frames, "--detector", "depthcn", "--on-bad-frame", "skip"
        )


# Several detectors


def test_detectors_stand_beside_each_other(
    car_frames, network_files, label_reader, tmp_path, capsys
):
    label_reader(car_frames)
    plot, out, worst = (tmp_path / name for name in ("curves.png", "metrics.json", "worst"))
    words = ("--iou", "0.5", "--bootstrap", "0", "--plot", plot, "--json", out)
    names = f"depthcn,{network_files['dm']}"
    assert evaluate(car_frames, "--detector", names, *words, "--worst-frames", worst) == 0
    printed = capsys.readouterr().out
    rows = rows_of(printed, car_frames, "Car: AP R40 [%] by detector and IoU")
    # Six cars, low in the image, which DepthCN finds, three milliseconds a frame; bright cells are cars nowhere.
    assert rows["depthcn 0.5"] == ["-", "12.50", "12.50", "3.0"]
    assert rows["dm.onnx 0.5"][:3] == ["-", "0.00", "0.00"]
    assert rows["perfect detector"] == ["-", "12.50", "12.50", "-"]
    assert rows["Objects: 0 easy, 6 moderate, 6 hard"] == []
    document = json.loads(out.read_text())
    detectors = document["results"][str(car_frames)]["detectors"]
    assert list(detectors) == ["depthcn", "dm.onnx"]
    found = detectors["depthcn"]["classes"]["Car"]["0.5"]["moderate"]
    assert (found["objects"], found["ap_r40_percent"]) == (6, 12.5)
    assert list(document["networks"]) == ["depthcn", "dm.onnx dm"]
    assert plot.stat().st_size > 10_000


def test_frames_are_read_once_for_all_detectors(car_frames, network_files, monkeypatch, capsys):
    read = []
    frames = measured_drives.read_frames
    monkeypatch.setattr(
        measured_drives,
        "read_frames",
        lambda *given, **named: (read.append(one) or one for one in frames(*given, **named)),
    )
    names = f"{network_files['dm']},{network_files['rm']}"
    assert evaluate(car_frames, "--detector", names, "--iou", "0.5", "--bootstrap", "0") == 0
    assert len(read) == 3
    assert "rm.onnx 0.5" in capsys.readouterr().out


@pytest.mark.parametrize(("names", "found"), [((), "none"), (("dm", "dm"), "dm, dm")])
def test_no_detector_or_one_twice(names, found):
    options = DetectorOptions(DetectionConfig(), (), PrecisionConfig())
    with fault(UsageError, where="--detector", found=found):
        open_compared(names, options)


# A detector of one modality


@dataclass
class KnownNetwork:
    """A network that detects the labelled boxes of one frame after the other, and one false positive in each."""

    predictions: list[Detections]
    modality: str = "dm"
    filling: str = "default"
    class_names: tuple[str, ...] = ("Car", "Cyclist")
    size: InputSize = field(default_factory=lambda: InputSize(64, 96))

    def __post_init__(self):
        self.title = "known.onnx"
        self.metadata = {"training_data": "no street"}

    def detect(self, image, region=None, first_row=0):
        assert image.shape == (190, 620, 1)
        return self.predictions.pop(0)


@pytest.fixture
def known_network(car_frames, monkeypatch):
    """Put a network in place that knows the frames, but misses the second car of the last."""
    drive = open_drive(car_frames)
    predictions = []
    for index in range(len(drive)):
        boxes_px = drive.labels(index).boxes_px[: 1 if index == len(drive) - 1 else 2]
        boxes_px = np.concatenate([boxes_px, [[500.0, 10, 600, 80]]])
        scores = np.array([0.9, 0.8, 0.3])[-len(boxes_px) :]
        predictions.append(Detections(boxes_px, scores, np.full(len(boxes_px), "Car")))
    network = KnownNetwork(predictions)
    monkeypatch.setattr(measured_detectors, "ModalityDetector", lambda model, nms: network)


def test_modality_table_plot_document_and_worst_frames(car_frames, known_network, tmp_path, capsys):
    plot, out, worst = tmp_path / "rm.png", tmp_path / "rm.json", tmp_path / "worst"
    words = ("--detector", "dm", "--classes", "car", "--bootstrap", "20", "--worst-count", "2")
    words += ("--plot", plot, "--json", out, "--worst-frames", worst)
    assert evaluate(car_frames, *words) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("known.onnx: dm, 64x96\n")
    row = rows_of(printed, car_frames, "average precision of dm")["Car moderate 0.7"]
    # Five of six cars are found and nothing else with such a score.
    assert row[:4] == ["6", "5", "83.3", "10.00"]
    assert row[-1] == "12.5"
    document = json.loads(out.read_text())
    assert document["split"] == "dm was trained on: no street"
    hard = document["results"][str(car_frames)]["classes"]["Car"]["0.5"]["hard"]
    assert (hard["objects"], hard["found"], hard["ap_r40_percent"]) == (6, 5, 10.0)
    assert hard["ap_r40_low_percent"] <= 10.0 <= hard["ap_r40_high_percent"]
    assert plot.stat().st_size > 10_000
    # Only the last frame has an error at the best score: there the second car is missed.
    (image,) = worst.iterdir()
    assert image.name.endswith("_cars_Car_00_000003.jpg")


def test_every_class_of_the_network_has_rows(car_frames, known_network, capsys):
    words = ("--detector", "dm", "--iou", "0.5", "--bootstrap", "0")
    assert evaluate(car_frames, *words) == 0
    rows = rows_of(capsys.readouterr().out, car_frames, "average precision of dm")
    assert rows["Car moderate 0.5"][:2] == ["6", "5"]
    assert rows["Cyclist easy 0.5"] == ["0", "-", "-", "-", "-"]


def test_a_class_that_the_network_does_not_know(known_network):
    with pytest.raises(UsageError) as error:
        open_detector("dm", DetectorOptions(DetectionConfig(), ("Tram",), PrecisionConfig()))
    assert (error.value.where, error.value.found) == ("--classes", "Tram")
    assert error.value.expected == "Car, Cyclist"


def test_a_detector_that_does_not_exist():
    with pytest.raises(UsageError) as error:
        open_detector("lidar", DetectorOptions(DetectionConfig(), (), PrecisionConfig()))
    assert (error.value.where, error.value.found) == ("--detector", "lidar")


def test_a_file_that_is_no_detector(tmp_path):
    with pytest.raises(ModelError) as error:
        open_detector(
            str(tmp_path / "none.onnx"), DetectorOptions(DetectionConfig(), (), PrecisionConfig())
        )
    assert error.value.where == "none.onnx"


@pytest.mark.parametrize(
    ("words", "where", "found"),
    [
        (("--worst-count", "0"), "--worst-count", "0"),
        (("--frames", "0"), "--frames", "0"),
        (("--iou", "1"), "--iou", "1"),
        (("--recall-points", "20"), "--recall-points", "20"),
        (("--bootstrap", "-1"), "--bootstrap", "-1"),
        (("--reliability-plot", "a.png"), "--reliability-plot", "depthcn"),
        (("--sequence", "0000"), "sequence 0000", "cars"),
    ],
)
def test_flags_out_of_range(car_frames, label_reader, words, where, found):
    label_reader(car_frames)
    with fault(UsageError, where=where, found=found):
        command("evaluate", "detection", car_frames, "--detector", "depthcn", *words)


# The fusion


class KeepScores:
    """A fusion that keeps every score and the best box of each place."""

    variant, class_names = "default", ("Car",)
    metadata = {"training_data": "no street"}  # noqa: RUF012 - never changed

    def rescore(self, scene):
        return SimpleNamespace(detections=scene.merged.detections)

    def fuse(self, scene):
        return NmsFusion().fuse(scene)


@pytest.fixture
def network_files(tmp_path):
    """Return files of three detectors, and of two of the three fusions."""
    files = {name: tmp_path / f"{name}.onnx" for name in (*MODALITIES, "scores", "default")}
    for name, file in files.items():
        is_detector = name in MODALITIES
        file.write_bytes(bright_cells(name) if is_detector else weighted_sums(name, AS_IT_WAS))
    return files


@pytest.fixture
def known_scenes(monkeypatch, tmp_path):
    """Let the camera see the first car and a false positive, the depth map both cars, reflectance nothing."""

    def see(drive, index, detectors, store):
        boxes_px = drive.labels(index).boxes_px
        ghost = [[500.0, 10, 600, 80]]
        cars = np.full(2, "Car")
        modality_detections = {
            "rgb": Detections(np.concatenate([boxes_px[:1], ghost]), np.array([0.9, 0.95]), cars),
            "dm": Detections(boxes_px, np.array([0.6, 0.5]), cars),
            "rm": Detections.empty(),
        }
        return DetectedScene(modality_detections, (620, 190))

    def network(name):
        model = SimpleNamespace(name=f"{name}.onnx", fingerprint="0123456789abcdef")
        known = {"metadata": {"training_data": "a"}, "class_names": ("Car",)}
        return SimpleNamespace(**known, model=model, fingerprint=model.fingerprint)

    networks = {name: network(name) for name in MODALITIES}
    fusions = {"scores": KeepScores(), "default": KeepScores()}
    opened = SimpleNamespace(detectors=networks)
    monkeypatch.setattr(measured_detectors, "open_modalities", lambda config: opened)
    monkeypatch.setattr(
        measured_detectors, "open_fusions", lambda config, further, detector: fusions
    )
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(measured_detectors, "detected_scene", see)


def test_fusion_tables_and_document(car_frames, known_scenes, tmp_path, capsys):
    plot, calibration, out = (tmp_path / name for name in ("a.png", "b.png", "c.json"))
    words = ("--plot", plot, "--reliability-plot", calibration, "--json", out)
    assert evaluate(car_frames, *words, "--bootstrap", "20", "--iou", "0.7") == 0
    printed = capsys.readouterr().out
    rows = rows_of(printed, car_frames, "AP R40 [%], IoU over 0.7")
    # Six cars: 12.5 is the maximum for so few, and what the depth map reaches by itself. The camera finds three
    # with a false positive of a higher score in each frame: a half at recall 1/40 and 2/40.
    assert "2.50" in rows["color"]
    assert "12.50" in rows["depth"]
    assert "12.50" in rows["perfect detector"]
    assert rows["fusion on scores"][-3:] == ["74.21", "62.18", "54.06"]
    document = json.loads(out.read_text())
    drive = document["results"][str(car_frames)]
    assert drive["benchmark"]["Car"]["image"]["0.7"]["moderate"]["found"] == 6
    drive = drive["classes"]["Car"]
    # The false positives come first: of nine detections, six are correct at the end.
    merged = drive["rows"]["merged by NMS"]["0.7"]["moderate"]
    fused = drive["rows"]["Trifuse fusion"]["0.7"]["moderate"]
    expected = pytest.approx(100 * 5 * 6 / 9 / 40)
    assert merged["ap_r40_percent"] == fused["ap_r40_percent"] == expected
    gain = drive["gain_points"]["Trifuse fusion"]["0.7"]["moderate"]
    assert gain["points"] == pytest.approx(100 * 5 * (6 / 9 - 1) / 40)
    assert gain["interval"]["low"] <= gain["points"] <= gain["interval"]["high"]
    assert drive["thesis_table_7_10"]["color"] == [73.93, 61.69, 54.0]
    assert "rgb was trained on: a" in document["split"]
    assert plot.stat().st_size > 10_000
    assert calibration.stat().st_size > 10_000


def test_fusion_with_missing_modalities(car_frames, known_scenes, tmp_path, capsys):
    out = tmp_path / "metrics.json"
    assert evaluate(car_frames, "--iou", "0.5", "--json", out) == 0
    printed = capsys.readouterr().out
    rows = rows_of(printed, car_frames, "Missing modalities: AP R40 [%]")
    assert "12.50" in rows["depth + reflectance"]
    # The thesis' metrics are of an IoU of 0.7.
    assert "thesis" not in printed
    missing = json.loads(out.read_text())["results"][str(car_frames)]["classes"]["Car"]
    missing = missing["missing_modalities"]
    assert list(missing["rows"]) == ["rgb+dm", "rgb+rm", "dm+rm", "rgb", "dm", "rm"]
    gains = {name: one["0.5"]["moderate"]["points"] for name, one in missing["gain_points"].items()}
    assert gains["rgb"] == gains["dm"] == gains["rm"] == gains["dm+rm"] == 0
    assert gains["rgb+dm"] < 0
    assert missing["rows"]["rm"]["0.5"]["moderate"]["curve"] is None


def test_networks_of_files_detect_in_each_frame_once(
    network_files, car_frames, tmp_path, monkeypatch, capsys
):
    calls = []
    detect = MultimodalDetector.detect
    monkeypatch.setattr(
        MultimodalDetector, "detect", lambda *given: calls.append(given) or detect(*given)
    )
    words = [f"--detection.{name}-model={network_files[name]}" for name in MODALITIES]
    words += [f"--detection.fusion-model={network_files['default']}"]
    words += ["--fusions", network_files["scores"]]
    words += ["--cache", tmp_path / "cache", "--iou", "0.5"]
    assert evaluate(car_frames, *words) == 0
    first = capsys.readouterr().out
    assert evaluate(car_frames, *words) == 0
    assert capsys.readouterr().out == first
    assert len(calls) == 3
    rows = rows_of(first, car_frames, "AP R40 [%], IoU over 0.5")
    # There is no image.
    assert list(rows)[:2] == ["depth", "reflectance"]
    assert "fusion on scores" in rows


def test_a_file_of_another_modality_is_refused(network_files):
    config = DetectionConfig(rgb_model=network_files["dm"])
    with pytest.raises(ModelError) as error:
        measured_detectors.open_modalities(config)
    assert error.value.where == "dm.onnx"
    assert "rgb" in error.value.expected
