import json
from dataclasses import dataclass
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from benchmarks.studies import speed, stages
from benchmarks.studies.dense_cloud import cut_out, dense_cloud, disagreement_m, find_pole
from benchmarks.studies.gates import gates, passes_gate
from benchmarks.studies.ground_error import GroundErrorConfig, ground_error
from benchmarks.studies.masks import masks
from benchmarks.studies.merged_frame import MergedFrameFlags, read_merged_frame
from benchmarks.studies.report import DriveOfStudy
from benchmarks.studies.stages import chain_config, frames_per_s, mean_times_s, stage_times
from data.synthetic.drive import CachedDrive
from perception.cli.main import main
from perception.errors import DriveError, UsageError
from perception.evaluation.ground import GroundErrors
from perception.geometry.grids import LocalArea
from perception.localization.registration import register_window
from perception.localization.scan_window import DenseCloud
from perception.obstacles.ground_planes import PiecewisePlanes
from perception.sensor import HDL_32E
from tests.faults import command, fault


@dataclass(frozen=True)
class LevelGround:
    def height_m(self, xy_m):
        return np.full(len(xy_m), -1.7)

    def distance_m(self, points_velo):
        return points_velo[:, 2] + 1.7


@pytest.fixture(scope="module")
def drive():
    return CachedDrive(8, sensor=HDL_32E)


def in_memory(kind, drive, **values):
    """Return flags that open a drive in memory."""

    class InMemory(kind):
        def open(self, path, *, images=False):
            return drive

    return InMemory(**values)


def numbers_of(plot_path):
    return json.loads(plot_path.with_suffix(".json").read_text())["results"]


def is_plot(path):
    image = cv2.imread(str(path))
    return image is not None and image.shape[0] > 400 and image.std() > 5


def pole_at(x, y, shift_m=0.0):
    """Three scans of a pole, each shifted along x by so much from the one after it."""
    z = np.linspace(-1.6, 0.5, 40)
    scans = [
        np.column_stack([np.full(40, x + age * shift_m), np.full(40, y), z, np.zeros(40)])
        for age in range(3)
    ]
    return np.concatenate(scans).astype(np.float32), np.repeat(np.arange(3, dtype=np.uint8), 40)


def wall():
    y, z = np.meshgrid(np.linspace(-8, 8, 300), np.linspace(-1.6, 0.3, 20))
    points = np.column_stack([np.full(y.size, 15.0), y.ravel(), z.ravel(), np.zeros(y.size)])
    return points.astype(np.float32), np.arange(y.size).astype(np.uint8) % 3


def test_the_pole_is_found_beside_a_wall():
    parts = [pole_at(6.0, 3.0), wall()]
    cloud = DenseCloud(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    np.testing.assert_allclose(find_pole(cloud, LevelGround(), LocalArea()), (6, 3), atol=0.31)


def test_a_cloud_without_a_pole_is_an_error():
    with fault(DriveError, where="study dense-cloud", found="none", advice="--frame"):
        find_pole(DenseCloud(*wall()), LevelGround(), LocalArea())


def test_scans_that_agree_are_not_apart():
    cloud = DenseCloud(*pole_at(6.0, 3.0))
    pole = cut_out(cloud, LevelGround(), np.array([6.0, 3.0]))
    assert disagreement_m(pole) == pytest.approx(0)


def test_scans_that_disagree_are_apart_by_their_shift():
    # The earlier scans are 0.1 and 0.2 m off the newest: RMS sqrt((0.01 + 0.04) / 2).
    pole = cut_out(DenseCloud(*pole_at(6.0, 3.0, 0.1)), LevelGround(), np.array([6.0, 3.0]))
    assert disagreement_m(pole) == pytest.approx(np.sqrt(0.025), abs=1e-3)


def test_a_gate_lets_through_what_lies_between_its_limits():
    level = np.array([[0, 0, 1, 1.7]] * 2)
    gates_m = np.array([(-1.8, -1.6), (-1.9, -1.5)])
    planes = PiecewisePlanes(np.array([5.0]), level, level, gates_m, np.array([True, True]))
    points = np.array([(1, 0, -1.7), (1, 0, -1.55), (9, 0, -1.55), (9, 0, -1.0)])
    assert passes_gate(points, planes).tolist() == [True, False, True, False]


def merged_frame(drive):
    return in_memory(MergedFrameFlags, drive, frame=6, previous_scans=3)


def test_gates(drive, tmp_path, capsys):
    plot_path = tmp_path / "new" / "gates.png"
    gates("memory", window=merged_frame(drive), out=plot_path)
    assert is_plot(plot_path)
    numbers = numbers_of(plot_path)
    assert len(numbers["planes"]) == len(numbers["slices"])
    assert numbers["planes"][0][3] == pytest.approx(HDL_32E.height_m, abs=0.1)
    first = numbers["slices"]["S0"]
    assert (first["from [m]"], first["to [m]"]) == (-5, 5)
    assert first["in gate"] < first["points"]
    assert "δψ [deg]" in capsys.readouterr().out


def test_masks(drive, tmp_path):
    plot_path = tmp_path / "masks.png"
    masks("memory", window=merged_frame(drive), out=plot_path)
    assert is_plot(plot_path)
    points = {name: row["points in them"] for name, row in numbers_of(plot_path)["steps"].items()}
    assert points["(c) static after subtraction"] < points["(b) merged"]
    assert points["(f) static"] <= points["(c) static after subtraction"]


def test_dense_cloud(drive, tmp_path):
    plot_path = tmp_path / "cloud.png"
    points = drive[6].points_velo
    upright = points[(points[:, 2] > -1.2) & (points[:, 2] < 0) & LocalArea().contains_xy(points)]
    dense_cloud(
        "memory", window=merged_frame(drive), at=tuple(upright[0, :2].tolist()), out=plot_path
    )
    assert is_plot(plot_path)
    assert set(numbers_of(plot_path)["clouds"]) == {
        "INS alone",
        "thesis: BGF and ICP",
        "default: GICP to a keyframe",
    }


def test_ground_error(drive, tmp_path, capsys):
    config = in_memory(
        GroundErrorConfig, drive, previous_scans=(1, 3), steps_per_slice=(1, 2), every=3
    )
    plot_path = tmp_path / "error.png"
    ground_error("memory", config=config, out=plot_path)
    assert is_plot(plot_path)
    mde_mm = numbers_of(plot_path)["mde_mm"]
    assert list(mde_mm) == ["m = 1", "m = 3"]
    # One step a slice follows a slope late: 0.03 to 0.4 m from street to street.
    assert all(0 < row["η = 1"] < 400 for row in mde_mm.values())
    assert all(0 < row["η = 2"] < 100 for row in mde_mm.values())
    assert numbers_of(plot_path)["objects"] > 0
    assert "η = 2" in capsys.readouterr().out


def test_ground_error_is_averaged_over_the_frames_of_all_sequences(drive, tmp_path, monkeypatch):
    class Sequences(GroundErrorConfig):
        def open(self, path, *, images=False):
            return SimpleNamespace(name=self.sequence)

    def errors_of(one, config):
        # Two frames of 0000 with 0.1 and 0.3 m, and two of 0011 with 0.4 m.
        distances_m = {"0000": [0.1, 0.3], "0011": [0.4, 0.4]}[one.name]
        return {(6, 6): GroundErrors(np.arange(2), np.zeros((2, 2)), np.array(distances_m))}

    for name in ("velodyne/0000", "velodyne/0011", "label_02"):
        (tmp_path / "training" / name).mkdir(parents=True)
    monkeypatch.setattr("benchmarks.studies.ground_error.measure_ground_errors", errors_of)
    config = Sequences(set="table-3.1", previous_scans=(6,), steps_per_slice=(6,))
    ground_error(str(tmp_path), config=config, out=tmp_path / "error.png")
    document = json.loads((tmp_path / "error.json").read_text())
    assert document["conditions"]["drive"] == "0000, 0011"
    assert document["results"]["mde_mm"]["m = 6"]["η = 6"] == pytest.approx(300)
    assert document["results"]["frames"] == 4


def test_ground_error_needs_labels(tmp_path):
    blind = in_memory(GroundErrorConfig, SimpleNamespace(has_labels=False, root="drive"))
    with fault(DriveError, where="drive", expected="labelled boxes", found="none"):
        ground_error("memory", config=blind, out=tmp_path / "x.png")


def test_the_stages_of_either_method_are_timed_on_the_same_frames(drive):
    for method in ("thesis", "default"):
        times = stage_times(drive, chain_config(method, 2, voxel_size_m=0.4), 4, 2)
        assert len(times) == 2
        assert list(times[0]) == list(stages.PUBLISHED_PERCENT)
        assert min(times[0].values()) > 0


def test_the_chain_has_the_parameters_of_the_study():
    config = chain_config("thesis", 4, voxel_size_m=0.2)
    assert (config.method, config.datmo.method) == ("thesis", "none")
    assert (config.motion.previous_scans, config.motion.voxel_size_m) == (4, 0.2)


def test_times_are_averaged_over_frames():
    times = [{"a": 0.1, "b": 0.1}, {"a": 0.3, "b": 0.1}]
    assert mean_times_s(times) == pytest.approx({"a": 0.2, "b": 0.1})
    assert frames_per_s(times) == pytest.approx(1 / 0.3)


TIMES = [{"registration": 0.010, "ground": 0.005, "voxels": 0.004, "static and moving": 0.001}]


def test_stages(drive, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(stages, "stage_times", lambda *_: TIMES)
    plot_path = tmp_path / "stages.png"
    stages.stages("memory", source=in_memory(DriveOfStudy, drive), frames=1, out=plot_path)
    assert cv2.imread(str(plot_path)) is not None
    rows = numbers_of(plot_path)["stages"]
    assert list(rows) == [
        *("(a) registration", "(b) ground", "(c) voxels", "(d) static and moving", "all stages")
    ]
    published = [row["published [%]"] for row in rows.values()]
    assert published == pytest.approx([83.2, 7.1, 7.7, 2.0, 100])
    assert [row["default [%]"] for row in rows.values()] == pytest.approx([50, 25, 20, 5, 100])
    assert [row["thesis [ms]"] for row in rows.values()] == pytest.approx([10, 5, 4, 1, 20])
    words = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["(c)", "voxels", "7.7", "20.0", "20.0", "4.0", "4.0"] in words


def test_speed(drive, tmp_path, monkeypatch):
    monkeypatch.setattr(speed, "stage_times", lambda *_: TIMES)
    config = in_memory(
        speed.SpeedConfig, drive, previous_scans=(1, 6), voxel_sizes_m=(0.1, 0.4), frames=1
    )
    plot_path = tmp_path / "speed.png"
    speed.speed("memory", config=config, out=plot_path)
    assert is_plot(plot_path)
    rows = numbers_of(plot_path)["frames_per_s"]
    assert [name.partition(",")[0] for name in rows] == ["thesis", "thesis", "default", "thesis"]
    assert rows["thesis, published, υ = 10 cm"] == {"m = 1": None, "m = 6": 0.3}
    assert rows["default, υ = 10 cm"] == pytest.approx({"m = 1": 50, "m = 6": 50})


def test_a_drive_too_short_to_be_timed_is_refused(drive):
    with fault(UsageError, where="--frames 5", expected="at most 2", found="5"):
        stage_times(drive, chain_config("thesis", 6), 6, 5)


def test_studies_of_the_thesis_register_the_window_by_icp(drive):
    # Algorithm 2 aligns with the newest scan, from the INS; the pose of the newest is that of the INS.
    merged = read_merged_frame(drive, MergedFrameFlags(frame=6, previous_scans=3))
    expected = register_window(merged.ins_window)
    for scan, other in zip(merged.window, expected, strict=True):
        np.testing.assert_allclose(scan.world_SE3_velo, other.world_SE3_velo, atol=1e-6)
    np.testing.assert_array_equal(merged.window.newest.world_SE3_velo, drive[6].world_SE3_velo)
    assert not np.allclose(
        merged.window.newest.world_SE3_velo, merged.odometry_window.newest.world_SE3_velo, atol=1e-9
    )


@pytest.mark.parametrize("frame", [0, 8, -3])
def test_a_frame_without_scans_before_it_is_refused(drive, frame):
    with fault(UsageError, where=f"frame {frame}", expected="from 1 to 7"):
        read_merged_frame(drive, MergedFrameFlags(frame=frame))


def test_a_folder_that_does_not_exist_is_an_error(tmp_path):
    with fault(DriveError, where="nothing", found="no such folder"):
        command("study", "gates", tmp_path / "nothing")


def test_registration_brings_a_real_pole_together(kitti_root, tmp_path):
    raw = kitti_root / "raw" / "2011_09_26" / "2011_09_26_drive_0005_sync"
    plot_path = tmp_path / "cloud.png"
    assert main(["study", "dense-cloud", str(raw), "--frame", "77", "--out", str(plot_path)]) == 0
    rows = numbers_of(plot_path)["clouds"]
    apart_cm = {name: row["scans apart [cm]"] for name, row in rows.items()}
    assert apart_cm["INS alone"] > 10
    assert apart_cm["thesis: BGF and ICP"] < 4
    assert apart_cm["default: GICP to a keyframe"] < 4
