"""nuScenes' tracking task: AMOTA and AMOTP of made-up tracks, and the devkit's values on a real scene."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from data.layouts import OpenConfig
from data.nuscenes.results import parse_sample
from data.nuscenes.samples import read_samples
from data.nuscenes.scene import open_scene
from data.nuscenes.task_tracks import tracked_boxes, tracked_scene
from data.result_files import ResultFiles
from perception.evaluation.nuscenes.tracking import (
    TaskTracks,
    TrackedScene,
    TrackMetrics,
    fill_gaps,
    measure_task_tracks,
)
from perception.types import BoxDeviations, Boxes3D, Detections, FusedDetections, Vehicles

NAMES = {
    "vehicle.bicycle": "bicycle", "vehicle.bus.rigid": "bus", "vehicle.car": "car", "vehicle.motorcycle": "motorcycle",
    "human.pedestrian.adult": "pedestrian", "vehicle.truck": "truck",
}  # fmt: skip
# Of nuscenes-devkit 1.2.0 with tracking_nips_2019 on `noisy_tracks`.
DEVKIT: dict[str, dict[str, float]] = {
    "bicycle": {
        "amota": 0.841666667,
        "amotp": 0.941258099,
        "recall": 0.947368421,
        "mota": 0.789473684,
        "motp": 0.831653252,
        "mt": 2,
        "ml": 0,
        "tp": 18,
        "fp": 3,
        "fn": 1,
        "ids": 0,
        "frag": 0,
    },
    "bus": {
        "amota": 0.925,
        "amotp": 0.76100595,
        "recall": 0.96969697,
        "mota": 0.939393939,
        "motp": 0.666315171,
        "mt": 1,
        "ml": 0,
        "tp": 31,
        "fp": 0,
        "fn": 1,
        "ids": 1,
        "frag": 0,
    },
    "car": {
        "amota": 0.849930075,
        "amotp": 0.83864451,
        "recall": 0.932905068,
        "mota": 0.800856531,
        "motp": 0.710323525,
        "mt": 53,
        "ml": 0,
        "tp": 1271,
        "fp": 149,
        "fn": 94,
        "ids": 36,
        "frag": 26,
    },
    "motorcycle": {
        "amota": 0.897049618,
        "amotp": 0.791747686,
        "recall": 0.95049505,
        "mota": 0.851485149,
        "motp": 0.675092038,
        "mt": 8,
        "ml": 0,
        "tp": 187,
        "fp": 15,
        "fn": 10,
        "ids": 5,
        "frag": 2,
    },
    "pedestrian": {
        "amota": 0.889144981,
        "amotp": 0.855797231,
        "recall": 0.933497537,
        "mota": 0.827586207,
        "motp": 0.794458945,
        "mt": 21,
        "ml": 0,
        "tp": 374,
        "fp": 38,
        "fn": 27,
        "ids": 5,
        "frag": 8,
    },
    "truck": {
        "amota": 0.826436193,
        "amotp": 0.885028861,
        "recall": 0.911392405,
        "mota": 0.835443038,
        "motp": 0.680529209,
        "mt": 3,
        "ml": 0,
        "tp": 69,
        "fp": 3,
        "fn": 7,
        "ids": 3,
        "frag": 1,
    },
    "mean": {
        "amota": 0.871537922,
        "amotp": 0.84558039,
        "recall": 0.940892575,
        "mota": 0.840706425,
        "motp": 0.726395357,
        "tp": 1950,
        "ids": 50,
    },
}


def tracks(*rows: tuple[int, int, float], score: float = 0.0, name: str = "car") -> TaskTracks:
    """Return boxes of tracks by frame, id and x."""
    frames, ids, x = np.array(rows, float).reshape(-1, 3).T
    places_m = np.column_stack([x, np.zeros(len(x))])
    types = np.full(len(x), name)
    return TaskTracks(types, frames.astype(int), ids.astype(int), places_m, np.full(len(x), score))


def measured(truths: TaskTracks, *found: TaskTracks, frames: int = 10) -> TrackMetrics:
    stamps_us = 500_000 * np.arange(frames)
    report = measure_task_tracks([TrackedScene(stamps_us, truths, TaskTracks.concatenate(found))])
    return report.classes["car"]


ROAD = tracks(*((frame, 1, 5.0 * frame) for frame in range(10)))


def test_perfect_tracks():
    car = measured(ROAD, tracks(*((frame, 7, 5.0 * frame + 0.5) for frame in range(10)), score=0.9))
    assert (car.objects, car.tp, car.fp, car.fn, car.ids, car.frag, car.mt, car.ml) == (
        *(10, 10, 0, 0),
        *(0, 0, 1, 0),
    )
    assert (car.amota, car.mota, car.motar, car.recall) == (1, 1, 1, 1)
    assert (car.amotp, car.motp) == (pytest.approx(0.5), pytest.approx(0.5))


def test_a_recall_that_is_not_reached_counts_2_m():
    car = measured(ROAD, tracks(*((frame, 7, 5.0 * frame + 0.5) for frame in range(5)), score=0.9))
    # 18 of 40 recalls from 0.1 to 1 lie at or below a half.
    assert (car.recall, car.mota, car.fn) == (0.5, 0.5, 5)
    assert car.amota == pytest.approx(18 / 40)
    assert car.amotp == pytest.approx((18 * 0.5 + 22 * 2) / 40)


def test_a_switch_is_no_true_positive_and_false_tracks_lower_the_accuracy():
    first = tracks(*((frame, 7, 5.0 * frame) for frame in range(5)), score=0.9)
    second = tracks(*((frame, 8, 5.0 * frame) for frame in range(5, 10)), score=0.8)
    false = tracks(*((frame, 9, 99.0) for frame in range(3)), score=0.95)
    car = measured(ROAD, first, second, false)
    assert (car.tp, car.ids, car.fp, car.fn) == (9, 1, 3, 0)
    assert (car.mota, car.motar) == (pytest.approx(1 - 4 / 10), pytest.approx(1 - 3 / 9))


def test_the_best_threshold_leaves_faint_false_tracks_out():
    true = tracks(*((frame, 7, 5.0 * frame) for frame in range(10)), score=0.9)
    false = tracks(*((frame, 9, 99.0) for frame in range(10)), score=0.5)
    assert measured(ROAD, true, false).amota == 1


def test_an_object_keeps_its_track_while_it_is_near():
    near = tracks(*((frame, 8, 5.0 * frame) for frame in range(1, 10)), score=0.95)
    own = tracks(*((frame, 7, 5.0 * frame + 1.5) for frame in range(10)), score=0.9)
    car = measured(ROAD, own, near)
    assert (car.tp, car.ids, car.fp) == (10, 0, 9)
    far = tracks((0, 7, 1.5), *((frame, 7, 5.0 * frame + 2) for frame in range(1, 10)), score=0.9)
    near.scores[:] = 0.85
    car = measured(ROAD, far, near)
    assert (car.tp, car.ids, car.fp) == (9, 1, 9)


def test_the_score_of_a_track_is_its_mean():
    strong = tracks(*((frame, 7, 5.0 * frame) for frame in range(10)), score=0.9)
    strong.scores[:5] = 0.1
    false = tracks(*((frame, 9, 99.0) for frame in range(10)), score=0.4)
    assert measured(ROAD, strong, false).amota == 1


def test_gaps_are_filled_from_the_first_box_to_the_last():
    stamps_us = 500_000 * np.arange(6)
    given = tracks((1, 3, 0.0), (4, 3, 9.0), (2, 5, 1.0))
    filled = fill_gaps(given, stamps_us)
    assert filled.frames.tolist() == [1, 4, 2, 2, 3]
    assert filled.ids.tolist() == [3, 3, 5, 3, 3]
    np.testing.assert_allclose(filled.places_m[:, 0], [0, 9, 1, 6, 3])  # as the devkit has them
    assert len(fill_gaps(tracks(), stamps_us)) == 0


def test_classes_without_objects_and_without_tracks():
    car = measured(ROAD, tracks((0, 7, 50.0), score=0.9))
    assert (car.amota, car.amotp, car.recall, car.mota, car.fn, car.ml) == (0, 2, 0, 0, 10, 1)
    stamps_us = np.arange(2)
    empty = TrackedScene(stamps_us, tracks(), tracks((0, 7, 50.0)))
    assert measure_task_tracks([empty]).classes == {}
    assert np.isnan(measure_task_tracks([empty]).mean.amota)


def test_vehicles_with_an_id_and_a_box_are_tracks_in_the_world_of_the_labels():
    unknown, count = np.full((4, 2), np.nan), 4
    bottom_m = np.array([[10.0, 0, -1.5], [0, 5, -1.5], [8, 8, -1.5], [np.nan, np.nan, np.nan]])
    found = Detections(
        np.zeros((count, 4)), np.ones(count), np.array(["Van", "Cyclist", "Car", "Car"])
    )
    fused = replace(FusedDetections.unfused(found), existence=np.array([0.9, 0.7, 0.8, 0.6]))
    vehicles = Vehicles(
        fused, np.array([4, 2, -1, 7]), Boxes3D(bottom_m, np.ones((count, 3)), bottom_m[:, 0]), unknown[:, 0],
        np.ones((count, 2)), np.full((count, 4, 4), np.nan), BoxDeviations.unknown(count), np.zeros(0, np.int64),
    )  # fmt: skip
    map_SE3_velo = np.array([[0.0, -1, 0, 100], [1, 0, 0, 50], [0, 0, 1, 2], [0, 0, 0, 1]])
    boxes = tracked_boxes(vehicles, map_SE3_velo)
    assert boxes.track_ids.tolist() == [4, 2]
    assert boxes.objects.types.tolist() == ["car", "bicycle"]
    assert boxes.scores.tolist() == [0.9, 0.7]
    np.testing.assert_allclose(boxes.objects.centers_m, [[100, 60, 1], [95, 50, 1]])
    np.testing.assert_allclose(boxes.objects.velocities_m_s, [[-1, 1], [-1, 1]])


def noisy_tracks(root: Path) -> dict[str, Any]:
    """Return the labels of the shared scene as tracks with noise, misses, other ids and false tracks."""
    rng = np.random.default_rng(3)
    tables = {
        name: json.loads((root / f"v1.0-mini/{name}.json").read_text())
        for name in ("sample", "sample_annotation", "instance", "category")
    }
    category = {one["token"]: one["name"] for one in tables["category"]}
    name_of = {one["token"]: NAMES.get(category[one["category_token"]]) for one in tables["instance"]}  # fmt: skip
    score_of = {one: rng.uniform(0.3, 1) for one in sorted(name_of)}
    samples: dict[str, Any] = {one["token"]: [] for one in tables["sample"]}
    order = {token: number for number, token in enumerate(samples)}
    for one in tables["sample_annotation"]:
        token, name = one["sample_token"], name_of[one["instance_token"]]
        if name is None or rng.random() < 0.2:
            continue
        number = order[token]
        place = np.round(np.array(one["translation"]) + rng.normal(0, 0.6, 3), 3)
        samples[token].append(
            {"sample_token": token, "translation": place.tolist(), "size": one["size"], "rotation": one["rotation"],
             "velocity": [0.0, 0.0], "tracking_id": f"{one['instance_token'][:8]}-{number // 25}", "tracking_name": name,
             "tracking_score": round(float(np.clip(score_of[one["instance_token"]] + rng.normal(0, 0.1), 0.01, 1)), 3)}
        )  # fmt: skip
        if rng.random() < 0.15:
            false = {
                **samples[token][-1],
                "tracking_id": f"false-{number // 5}-{len(samples[token])}",
            }
            false["translation"] = (place + np.array([6.0, 0, 0])).tolist()
            samples[token].append({**false, "tracking_score": round(float(rng.uniform(0, 0.8)), 3)})
    return {"meta": {"use_lidar": True}, "results": samples}


def test_a_real_scene_has_the_devkits_values(nuscenes_tables):
    files = ResultFiles(Path("tracks.json"), "tracks", "nuScenes", noisy_tracks(nuscenes_tables))
    samples = read_samples(open_scene(nuscenes_tables, "scene-0916", OpenConfig(images=False)))
    pairs = [(one, parse_sample(files, one.token)) for one in samples]
    task = measure_task_tracks([tracked_scene(pairs)])
    for name, expected in DEVKIT.items():
        row = task.mean if name == "mean" else task.classes[name]
        found = {key: getattr(row, key) for key in expected}
        assert found == pytest.approx(expected, abs=1e-6), name
