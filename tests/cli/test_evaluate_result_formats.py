"""`trifuse evaluate results` of JSON files: COCO's detections, nuScenes' detections and tracks."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from perception.cli.main import main
from perception.errors import DriveError, LabelError, UsageError
from tests.faults import command, fault
from tests.other_layouts import write_nuscenes
from tests.tiny_drive import TinyDrive

NO_BOX = "-1 -1 -1 -1000 -1000 -1000 -10"
FRAMES = 12
# Left, top, width, height of a car that moves by 40 px a frame, and of a pedestrian that stands.
CARS = [(50 + 40 * frame, 100, 100, 80) for frame in range(FRAMES)]
PERSON = (700, 90, 40, 110)


def evaluate(results: Path, labels: Path, *words: object) -> dict[str, Any]:
    """Return the document of a measurement."""
    out = results.parent / "made" / "metrics.json"
    run = ["evaluate", "results", results, "--labels", labels, "--bootstrap", 0, "--json", out]
    assert main(list(map(str, [*run, *words]))) == 0
    document: dict[str, Any] = json.loads(out.read_text())
    return document


# --- COCO -----------------------------------------------------------------------------------------


def found(frame: int, category: int, box: tuple[int, ...], score: float) -> dict[str, Any]:
    return {"image_id": frame, "category_id": category, "bbox": list(box), "score": score}


# A car in every frame but the last, shifted in every third; a person in every second, and one that is none.
DETECTIONS = [
    *(found(n, 3, (x + 60 * (n % 3 == 2), *box), 0.3 + n / 20) for n, (x, *box) in enumerate(CARS[:-1])),
    *(found(n, 1, PERSON, 0.9 - n / 20) for n in range(0, FRAMES, 2)),
    found(5, 1, (10, 10, 30, 90), 0.5),
]  # fmt: skip


@pytest.fixture
def labels(tmp_path: Path) -> Path:
    folder = tmp_path / "labels"
    folder.mkdir()
    for frame, car in enumerate(CARS):
        rows = [f"{kind} 0 0 0.5 {corners(box)} {NO_BOX}" for kind, box in (("Car", car), ("Pedestrian", PERSON))]  # fmt: skip
        (folder / f"{frame:06d}.txt").write_text("\n".join(rows))
    return folder


def corners(box: tuple[float, ...]) -> str:
    left, top, width, height = box
    return f"{left} {top} {left + width} {top + height}"


def write_coco(
    folder: Path, detections: object, categories: object = None, images: object = None
) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "found.json").write_text(json.dumps(detections))
    if categories is not None:
        document = {"categories": categories, "images": images}
        (folder / "instances.json").write_text(json.dumps(document))
    return folder / "found.json"


def test_coco_has_the_scores_of_the_same_boxes_in_kittis_files(labels, tmp_path):
    texts = tmp_path / "texts"
    texts.mkdir()
    names = {1: "Pedestrian", 3: "Car"}
    for frame in range(FRAMES):
        rows = [one for one in DETECTIONS if one["image_id"] == frame]
        (texts / f"{frame:06d}.txt").write_text(
            "".join(
                f"{names[one['category_id']]} -1 -1 -10 {corners(one['bbox'])} {NO_BOX} {one['score']}\n"
                for one in rows
            )
        )
    expected = evaluate(texts, labels)
    document = evaluate(write_coco(tmp_path / "coco", DETECTIONS[::-1]), labels)
    assert document["results"] == expected["results"]
    cars = document["results"]["Car"]["0.7"]["easy"]
    assert (cars["objects"], cars["found"]) == (12, 8)
    assert document["data"]["format"] == "COCO"
    assert document["data"]["notes"] == ["categories of COCO: 1 person as Pedestrian, 3 car as Car"]
    assert document["data"]["detections"] == len(DETECTIONS)


def test_categories_beside_the_results_name_them(labels, tmp_path, capsys):
    turned = [{**one, "category_id": 3 - one["category_id"]} for one in DETECTIONS]
    listed = [{"id": 0, "name": "car"}, {"id": 2, "name": "pedestrian"}, {"id": 1, "name": "tram"}]
    path = write_coco(tmp_path / "coco", turned, listed)
    (tmp_path / "coco" / "notes.json").write_text("[1, 2]")
    cars = evaluate(path, labels)["results"]["Car"]["0.7"]["easy"]
    assert (cars["objects"], cars["found"]) == (12, 8)
    note = f"categories of {tmp_path / 'coco' / 'instances.json'}: 0 car as Car, 2 pedestrian as Pedestrian"
    assert note in capsys.readouterr().out


def test_images_beside_the_results_name_frames(labels, tmp_path):
    listed = [{"id": 3, "name": "car"}, {"id": 1, "name": "person"}]
    images = [{"id": 900 - n, "file_name": f"image_2/{n:06d}.png"} for n in range(FRAMES)]
    detections = [{**one, "image_id": 900 - one["image_id"]} for one in DETECTIONS]
    path = write_coco(tmp_path / "coco", detections, listed, images)
    document = evaluate(path, labels)
    cars = document["results"]["Car"]["0.7"]["easy"]
    assert (cars["objects"], cars["found"]) == (12, 8)
    (note,) = document["data"]["notes"]
    assert note.startswith(f"categories and images of {tmp_path / 'coco' / 'instances.json'}: ")
    words = ("evaluate", "results", path, "--labels", labels)
    write_coco(tmp_path / "coco", DETECTIONS, listed, images)
    with fault(LabelError, "found.json [0] image_id", "an image of", "0"):
        command(*words)
    write_coco(tmp_path / "coco", detections, listed, [{"id": 900, "file_name": "a/left_7.png"}])
    with fault(LabelError, "instances.json image 900", "the number of a frame", "'a/left_7.png'"):
        command(*words)
    write_coco(tmp_path / "coco", detections, listed, [*images, {"id": 9}])
    with fault(LabelError, "instances.json images[12]", "a whole id and a file_name", "{'id': 9}"):
        command(*words)


def test_images_counted_from_one_are_scored_as_they_stand(labels, tmp_path, capsys):
    late = [{**one, "image_id": one["image_id"] + 1} for one in DETECTIONS if one["category_id"] == 3]  # fmt: skip
    cars = evaluate(write_coco(tmp_path / "coco", late), labels)["results"]["Car"]["0.7"]["easy"]
    assert (cars["objects"], cars["found"]) == (12, 0)
    printed = capsys.readouterr().out
    # The shifted third fits neither frame by half.
    assert "rows fit the labels of frame k-1 better than those of their own frame k" in printed
    assert "are frames counted from 1? They are scored as they stand." in printed


def test_an_empty_list_has_no_detections(labels, tmp_path, capsys):
    document = evaluate(write_coco(tmp_path / "coco", []), labels)
    assert document["data"]["detections"] == 0
    assert "Car: nothing detected, so it has no metrics." in capsys.readouterr().out


def test_images_that_have_no_labels_are_not_read(labels, tmp_path, capsys):
    path = write_coco(tmp_path / "coco", [*DETECTIONS, found(777, 3, PERSON, 1.0)])
    assert evaluate(path, labels)["data"]["detections"] == len(DETECTIONS)
    assert "1 images of other frames, the first 000777: not read" in capsys.readouterr().out
    path = write_coco(tmp_path / "coco", [found(777, 3, PERSON, 1.0)])
    with fault(DriveError, "found.json", "results of the 12 frames", "1 images of other frames"):
        command("evaluate", "results", path, "--labels", labels)


@pytest.mark.parametrize(
    ("change", "where", "expected", "given"),
    [
        ({"bbox": [1, 2, 3]}, "", "bbox of 4 numbers", "{'image_id': 0"),
        ({"image_id": 1.5}, " image_id", "a whole number", "1.5"),
        ({"image_id": "a.png"}, " image_id", "a whole number", "'a.png'"),
        ({"category_id": None}, " category_id", "a whole number", "None"),
        ({"category_id": 12}, " category_id", "a category of COCO", "12"),
        ({"score": float("nan")}, " score", "a number", "nan"),
        ({"score": True}, " score", "a number", "True"),
        ({"bbox": [1, 2, 3, -4]}, " bbox", "a size from 0 on", "-4"),
        ({"bbox": [1, "2", 3, 4]}, " bbox", "a number", "'2'"),
    ],
)
def test_entries_that_are_no_detections(labels, tmp_path, change, where, expected, given):
    path = write_coco(tmp_path / "coco", [DETECTIONS[0], {**DETECTIONS[0], **change}])
    with fault(LabelError, f"found.json [1]{where}", expected, given):
        command("evaluate", "results", path, "--labels", labels)


def test_categories_without_a_name(labels, tmp_path):
    path = write_coco(tmp_path / "coco", DETECTIONS, [{"id": 3, "name": "car"}, {"id": 1}])
    with fault(LabelError, "instances.json categories[1]", "a whole id and a name", "{'id': 1}"):
        command("evaluate", "results", path, "--labels", labels)


@pytest.mark.parametrize(
    ("text", "given"),
    [
        ('{"annotations": [], "images": []}', "an object with annotations, images"),
        ('{"results": []}', "an object with results"),
        ("3", "int"),
        ('[{"image_id": 3', "no JSON (Expecting"),
        ("[" * 100_000, "no JSON (values too deep in each other)"),
        ("0 1 Car", "no JSON (Extra data"),
    ],
)
def test_other_documents(labels, tmp_path, text, given):
    path = tmp_path / "found.json"
    path.write_text(text)
    with fault(LabelError, str(path), "COCO's detections, or nuScenes'", given):
        command("evaluate", "results", path, "--labels", labels)


# --- nuScenes -------------------------------------------------------------------------------------


class LongDrive(TinyDrive):
    """A car ahead in twelve key frames, and as many sweeps between them."""

    def __len__(self) -> int:
        return 24


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_nuscenes(tmp_path_factory.mktemp("nuscenes"), LongDrive())


def annotations(root: Path, kind: str) -> dict[str, list[dict[str, Any]]]:
    """Return the labels of a scene as results."""
    records = json.loads((root / "v1.0-mini/sample_annotation.json").read_text())
    samples: dict[str, list[dict[str, Any]]] = {}
    for one in records:
        box = {name: one[name] for name in ("translation", "size", "rotation")}
        box |= {f"{kind}_name": "car", f"{kind}_score": 0.5, "attribute_name": ""}
        box |= {"tracking_id": one["instance_token"]} if kind == "tracking" else {}
        samples.setdefault(one["sample_token"], []).append(box)
    return samples


def write_scenes(folder: Path, samples: object) -> Path:
    path = folder / "results.json"
    path.write_text(json.dumps({"meta": {"use_lidar": True}, "results": samples}))
    return path


def test_labels_as_detections_are_perfect(root, tmp_path, capsys):
    samples = annotations(root, "detection")
    behind = [{**samples["sample-0"][0], "translation": [-20, 0, 0]}]
    samples = {**samples, "sample-0": samples["sample-0"] + behind, "elsewhere": []}
    document = evaluate(write_scenes(tmp_path, samples), root, "--protocol", "kitti")
    assert document["data"]["notes"] == [
        "scene-0061: 12 key frames; scored is what lies in the image of the front camera, 12 of 13 boxes",
        "1 samples of other scenes: not read",
    ]
    scores = document["results"]["benchmark"]["Car"]
    for name in ("image", "bev", "3d"):
        cars = scores[name]["0.7"]["easy"]
        assert (cars["objects"], cars["found"]) == (12, 12)
        assert cars["ap_r40_percent"] == cars["max_ap_r40_percent"]
    cars = scores["image"]["0.7"]["easy"]
    assert cars["aos_r40_percent"] == pytest.approx(cars["ap_r40_percent"])
    assert "12 detections in 12 frames" in capsys.readouterr().out


def test_detections_are_measured_by_nuscenes_own_protocol(root, tmp_path, capsys):
    samples = annotations(root, "detection")
    behind = [{**samples["sample-0"][0], "translation": [-20, 0, 0], "detection_score": 0.4}]
    moved = {**samples["sample-22"][0], "velocity": [5.0, 0.0]}
    moved["translation"] = [moved["translation"][0] + 1.5, *moved["translation"][1:]]
    samples = {
        **samples,
        "sample-0": samples["sample-0"] + behind,
        "elsewhere": [],
        "sample-22": [moved],
    }
    del samples["sample-2"]
    document = evaluate(write_scenes(tmp_path, samples), root)
    assert document["protocol"]["name"] == "nuScenes detection task, detection_cvpr_2019"
    assert document["data"]["notes"] == [
        "1 key frames without an entry: counted as no detection",
        "1 samples of other scenes: not read",
    ]
    results = document["results"]
    car = results["classes"]["car"]
    assert (car["objects"], car["detections"]) == (12, 12)
    # 10 of 12 are found nearer than 1 m; the first in the order of scores is the one that is 1.5 m away.
    near, far = car["AP"]["0.5"], car["AP"]["2.0"]
    assert car["AP"]["1.0"] == near < far == car["AP"]["4.0"]
    recalls = np.linspace(0, 1, 101)[11:]
    assert far == pytest.approx(0.9 / 0.9 * (recalls <= 11 / 12).mean())
    assert car["trans_err"] > 0.1 and car["scale_err"] == pytest.approx(0)
    assert results["classes"]["bus"]["mean_ap"] == 0
    assert results["mean_ap"] == pytest.approx((2 * near + 2 * far) / 40)
    errors = results["tp_errors"].values()
    assert results["nd_score"] == pytest.approx(
        (5 * results["mean_ap"] + sum(max(1 - one, 0) for one in errors)) / 10
    )
    assert "NDS " in capsys.readouterr().out


def test_boxes_beyond_the_limit_and_negative_scores(root, tmp_path):
    samples = annotations(root, "detection")
    words = ("evaluate", "results", tmp_path / "results.json", "--labels", root)
    box = samples["sample-2"][0]
    write_scenes(tmp_path, {**samples, "sample-2": [box] * 501})
    with fault(LabelError, "results.sample-2", "at most 500 boxes", "501"):
        command(*words)
    write_scenes(tmp_path, {**samples, "sample-2": [{**box, "detection_score": -0.5}]})
    with fault(LabelError, "results.sample-2", "scores from 0 on", "-0.5"):
        command(*words)


def test_detections_two_metres_farther_on(root, tmp_path):
    samples = annotations(root, "detection")
    for (box,) in samples.values():
        box["translation"][0] += 2.0  # half of the length of 4 m
    path = write_scenes(tmp_path, samples)
    cars = evaluate(path, root, "--protocol", "kitti")["results"]["benchmark"]["Car"]
    assert cars["bev"]["0.7"]["easy"]["found"] == cars["bev"]["0.5"]["easy"]["found"] == 0
    for (box,) in samples.values():
        box["translation"][0] -= 1.0  # 3 m of 5 m are shared
    path = write_scenes(tmp_path, samples)
    cars = evaluate(path, root, "--protocol", "kitti")["results"]["benchmark"]["Car"]
    assert (cars["bev"]["0.7"]["easy"]["found"], cars["bev"]["0.5"]["easy"]["found"]) == (0, 12)


def test_labels_as_tracks_are_perfect_until_an_id_changes(root, tmp_path, capsys):
    samples = annotations(root, "tracking")
    document = evaluate(write_scenes(tmp_path, samples), root)
    cars = document["results"]["scene-0061"]["car"]
    assert (cars["HOTA"], cars["TP"], cars["IDSW"]) == (1.0, 12, 0)
    assert document["data"]["frames"] == {"scene-0061": 12}
    task = document["results"]["nuscenes"]["classes"]["car"]
    assert (task["amota"], task["amotp"], task["tp"], task["ids"]) == (1.0, 0.0, 12, 0)
    for number, (box,) in enumerate(samples.values()):
        box["tracking_id"] = "early" if number < 6 else "late"
    del samples["sample-22"]
    document = evaluate(write_scenes(tmp_path, samples), root)
    cars = document["results"]["scene-0061"]["car"]
    assert (cars["TP"], cars["FN"], cars["IDSW"]) == (11, 1, 1)
    # The object is there in all samples; the last one has no entry, and the switch is no true positive.
    task = document["results"]["nuscenes"]["classes"]["car"]
    assert (task["tp"], task["fn"], task["ids"]) == (10, 1, 1)
    assert "1 key frames without an entry: counted as no detection" in capsys.readouterr().out


def test_tracks_are_measured_on_the_ground(root, tmp_path, capsys):
    samples = annotations(root, "tracking")
    for metres, hits in ((0, 12), (1, 12), (2, 0)):  # 3 of 5 m in common suffice, 2 of 6 m do not
        for sample, boxes in annotations(root, "tracking").items():
            samples[sample][0]["translation"][0] = boxes[0]["translation"][0] + metres
        document = evaluate(write_scenes(tmp_path, samples), root)
        cars = document["results"]["ground"]["Car"]
        assert (cars["TP"], cars["FP"], cars["FN"]) == (hits, 12 - hits, 12 - hits)
        assert cars["MOTP"] == pytest.approx((4 - metres) / (4 + metres) if hits else 0)
    assert "on the ground: boxes from above" in capsys.readouterr().out


def test_flags_that_do_not_apply(root, tmp_path):
    path = write_scenes(tmp_path, annotations(root, "tracking"))
    words = ("evaluate", "results", path, "--labels", root)
    with fault(UsageError, "--classes", "car, pedestrian", "cyclist"):
        command(*words, "--classes", "cyclist")
    with fault(UsageError, "--seqmap", "none, as nuScenes' results name their samples"):
        command(*words, "--seqmap", path)
    with fault(UsageError, "--kind detections", "tracks, as"):
        command(*words, "--kind", "detections")
    path = write_scenes(tmp_path, annotations(root, "detection"))
    with fault(UsageError, "--frame-list", "none, as nuScenes'"):
        command(*words, "--frame-list", path)
    with fault(UsageError, "--frame-list", "none, as nuScenes' results"):
        command(*words, "--frame-list", path, "--protocol", "kitti")
    with fault(UsageError, "--classes", "none, as nuScenes' detection task measures all classes"):
        command(*words, "--classes", "car")


def test_samples_of_other_tables(root, tmp_path):
    path = write_scenes(tmp_path, {"another": []})
    with fault(DriveError, "results.json", "results of the 13 samples", "1 of other samples"):
        command("evaluate", "results", path, "--labels", root)
    with fault(DriveError, str(tmp_path), "tables of nuScenes, as the results are of it", "none"):
        command("evaluate", "results", path, "--labels", tmp_path)


@pytest.mark.parametrize(
    ("change", "where", "expected", "given"),
    [
        ({"translation": [1, 2]}, "translation", "3 numbers", "[1, 2]"),
        ({"rotation": [0, 0, 0, 0]}, "rotation", "a unit quaternion", "[0.0, 0.0, 0.0, 0.0]"),
        ({"rotation": [1, 0, 0, float("inf")]}, "rotation", "4 numbers", "inf"),
        ({"size": [1, 0, 1]}, "size", "width, length and height above 0", "[1.0, 0.0, 1.0]"),
        ({"detection_name": "vehicle.car"}, "detection_name", "one of barrier", "'vehicle.car'"),
        ({"detection_score": "high"}, "detection_score", "a number", "'high'"),
        (
            {"attribute_name": "vehicle.red"},
            "attribute_name",
            "none or one of vehicle.moving",
            "'vehicle.red'",
        ),
        ({"velocity": [1]}, "velocity", "2 numbers", "[1]"),
        ({"velocity": [float("nan"), 1]}, "velocity", "2 numbers", "[nan, 1]"),
    ],
)
def test_boxes_that_cannot_be_read(root, tmp_path, change, where, expected, given):
    samples = annotations(root, "detection")
    samples["sample-2"][0] |= change
    path = write_scenes(tmp_path, samples)
    with fault(LabelError, f"{path} results.sample-2[0] {where}", expected, given):
        command("evaluate", "results", path, "--labels", root)


def test_samples_that_cannot_be_read(root, tmp_path):
    samples: dict[str, Any] = annotations(root, "tracking")
    words = ("evaluate", "results", tmp_path / "results.json", "--labels", root)
    for entry, expected, given in (
        (samples["sample-0"] * 2, "every tracking_id once in a sample", "'o-0007' again"),
        ([{**samples["sample-0"][0], "tracking_id": None}], "the name of a track", "None"),
        ({"box": 1}, "a list of boxes", "dict"),
        ([7], "3 numbers", "None"),
    ):
        write_scenes(tmp_path, {**samples, "sample-2": entry})
        with fault(LabelError, "results.sample-2", expected, given):
            command(*words)


def test_an_attribute_tells_that_a_bicycle_is_ridden():
    from data.nuscenes.results import parse_sample
    from data.result_files import ResultFiles

    box = {"translation": [1, 2, 3], "size": [2, 4, 6], "rotation": [0, 0, 0, 2], "detection_name": "bicycle"}  # fmt: skip
    boxes = [{**box, "detection_score": n, "attribute_name": name} for n, name in enumerate(("", "cycle.with_rider"))]  # fmt: skip
    files = ResultFiles(Path("a.json"), "detections", "nuScenes", {"results": {"s": boxes}})
    sample = parse_sample(files, "s")
    assert sample.types.tolist() == ["Misc", "Cyclist"]
    assert sample.scores.tolist() == [0, 1]
    # Turned about by pi; the bottom is 3 m below the centre.
    np.testing.assert_allclose(sample.boxes_world.bottom_m, [[1, 2, 0]] * 2, atol=1e-12)
    np.testing.assert_allclose(sample.boxes_world.size_m, [[4, 2, 6]] * 2)
    np.testing.assert_allclose(np.abs(sample.boxes_world.yaw_rad), np.pi)
    assert len(parse_sample(files, "none")) == 0
