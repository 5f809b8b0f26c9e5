"""What goes wrong in a drive ends tracks or not, but never a run, and never lends an id twice."""

from dataclasses import replace

import numpy as np
import pytest

from data.synthetic.drive import SyntheticDrive
from perception.datmo.config import DatmoConfig, DatmoMethod
from perception.datmo.detector import SegmentedScan
from perception.datmo.stage import datmo_stage
from perception.geometry import se3
from perception.pipeline import Pipeline, PipelineConfig
from perception.pipeline.lidar_stages import LidarStages
from perception.types import INS, Frame, HealthLevel, Tracks

FRAMES = 24
METHODS: tuple[DatmoMethod, ...] = ("default", "thesis", "author")


@pytest.fixture(scope="module")
def drive() -> SyntheticDrive:
    return SyntheticDrive(FRAMES, seed=3, images=False)


@pytest.fixture(scope="module")
def frames(drive: SyntheticDrive) -> list[Frame]:
    return list(drive)


@pytest.fixture(scope="module")
def scans(drive: SyntheticDrive, frames: list[Frame]) -> list[SegmentedScan]:
    chain = LidarStages(drive.sensor, PipelineConfig.for_motion("none"))
    return [chain.segment(frame)[1] for frame in frames]


def track(scans: list[SegmentedScan], method: DatmoMethod, drive: SyntheticDrive) -> list[Tracks]:
    stage = datmo_stage(
        DatmoConfig(method=method), drive.sensor, PipelineConfig().area_of(drive.sensor)
    )
    assert stage is not None
    results = [stage.update(scan) for scan in scans]
    for tracks in results:
        assert np.isfinite(tracks.boxes.bottom_m).all()
        assert np.isfinite(tracks.velocities_m_s).all()
        assert (np.diff(tracks.ids) > 0).all()
    return results


def ids_of(results: list[Tracks]) -> set[int]:
    return {int(track_id) for tracks in results for track_id in tracks.ids}


def with_stamps(scans: list[SegmentedScan], stamps_s: list[float]) -> list[SegmentedScan]:
    return [replace(scan, stamp_s=s) for scan, s in zip(scans, stamps_s, strict=True)]


def emptied(scan: SegmentedScan) -> SegmentedScan:
    return replace(scan, points_velo=scan.points_velo[:0], point_states=scan.point_states[:0])


def moved(scan: SegmentedScan, shift: np.ndarray) -> SegmentedScan:
    return replace(
        scan,
        world_SE3_velo=shift @ scan.world_SE3_velo,
        ins_world_SE3_velo=shift @ scan.ins_world_SE3_velo,
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_street_has_tracks(scans, drive, method):
    results = track(scans, method, drive)
    assert ids_of(results)


def test_no_method_is_no_stage(drive):
    assert datmo_stage(DatmoConfig(method="none"), drive.sensor) is None


@pytest.mark.parametrize("method", METHODS)
def test_a_repeated_frame_repeats_the_tracks(scans, drive, method):
    twice = [scans[i] for i in range(FRAMES) for _ in range(2)]
    results = track(twice, method, drive)
    for first, second in zip(results[::2], results[1::2], strict=True):
        assert np.array_equal(first.ids, second.ids)
        assert np.allclose(first.boxes.bottom_m, second.boxes.bottom_m)


@pytest.mark.parametrize("method", METHODS)
def test_a_short_gap_keeps_ids_rising(scans, drive, method):
    """Three frames are missing; what is known goes on or ends."""
    kept = scans[:10] + scans[13:]
    results = track(kept, method, drive)
    newcomers = ids_of(results[10:]) - ids_of(results[:10])
    assert not newcomers or min(newcomers) > max(ids_of(results[:8]))


def test_the_default_survives_a_short_gap(scans, drive):
    results = track(scans[:12] + scans[14:], "default", drive)
    assert set(results[12].ids) & set(results[11].ids)


@pytest.mark.parametrize("method", METHODS)
def test_after_a_long_gap_all_tracks_are_new(scans, drive, method):
    stamps = [scan.stamp_s + (60.0 if i >= 12 else 0.0) for i, scan in enumerate(scans)]
    far = np.eye(4)
    far[:3, 3] = 300.0, 200.0, 0.0
    later = with_stamps([*scans[:12], *(moved(scan, far) for scan in scans[12:])], stamps)
    results = track(later, method, drive)
    assert not ids_of(results[:12]) & ids_of(results[13:])


@pytest.mark.parametrize("method", METHODS)
def test_a_jump_of_the_pose_ends_no_run(scans, drive, method):
    """The INS jumps by 50 m and says nothing: tracks of before are left behind."""
    jump = se3.from_euler(0, 0, np.radians(30), np.array([50.0, -20.0, 0.5]))
    results = track([*scans[:12], *(moved(scan, jump) for scan in scans[12:])], method, drive)
    newcomers = ids_of(results[16:]) - ids_of(results[:12])
    assert not newcomers or min(newcomers) > max(ids_of(results[:12]))


@pytest.mark.parametrize("method", METHODS)
def test_a_reset_ends_all_tracks(scans, drive, method):
    scans = [replace(scan, is_reset=i == 12) for i, scan in enumerate(scans)]
    results = track(scans, method, drive)
    assert not ids_of(results[:12]) & ids_of(results[12:])


@pytest.mark.parametrize("method", METHODS)
def test_an_empty_scan_passes(scans, drive, method):
    holed = [emptied(scan) if i in (0, 11, 12) else scan for i, scan in enumerate(scans)]
    results = track(holed, method, drive)
    assert ids_of(results)


def test_the_default_survives_an_empty_scan(scans, drive):
    holed = [emptied(scan) if i == 12 else scan for i, scan in enumerate(scans)]
    results = track(holed, "default", drive)
    assert set(results[11].ids) & set(results[12].ids) & set(results[13].ids)
    assert not results[12].is_observed.any()


@pytest.mark.parametrize("method", METHODS)
def test_without_ins_objects_are_tracked(drive, frames, method):
    pipeline = Pipeline(drive.sensor, PipelineConfig.for_motion(method))
    ids = set()
    for frame in frames[:12]:
        tracks = pipeline.step(replace(frame, world_SE3_velo=None)).tracks
        ids |= set(tracks.ids.tolist())
    assert ids


def test_a_jumping_ins_is_named_and_left_out_and_tracks_go_on(drive, frames):
    pipeline = Pipeline(drive.sensor, PipelineConfig.for_motion())
    for frame in frames[:12]:
        before = pipeline.step(frame)
    far = frames[12].world_SE3_velo.copy()
    far[:3, 3] += 500.0
    jumped = pipeline.step(replace(frames[12], world_SE3_velo=far))
    after = pipeline.step(frames[13])
    assert [(one.part, one.level, one.fault) for one in jumped.health.findings] == [
        (INS, HealthLevel.ERROR, "INS jumping")
    ]
    assert before.health.level_of(INS) == after.health.level_of(INS) == HealthLevel.OK
    off_m = (jumped.world_SE3_velo - frames[12].world_SE3_velo)[:3, 3]
    assert np.linalg.norm(off_m) < 0.1
    assert set(before.tracks.ids) & set(jumped.tracks.ids) & set(after.tracks.ids)
