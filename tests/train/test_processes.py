"""Trainings in real processes: two train as one does, and a killed one resumes as if nothing had happened."""

import json
import signal
from pathlib import Path

import numpy as np
import pytest
import torch

from perception.detection.detectors.postprocess import postprocess_detections
from tests.car_frames import write_car_frames
from tests.train.forked import Job, run_jobs
from tests.train.fusion.toy_rows import LM, toy_words
from tests.train.toy_images import SIZE, TINY, ToyImages, tiny_network
from tests.train.trainings import LOGGED
from train.checkpoints import read_checkpoint
from train.detector import networks
from train.detector.metrics import ValidationBoxes, measure, precision_table
from train.detector.networks import MODEL, load_detector

EPOCHS = 2
# Batches of an epoch of each training.
BATCHES = {"detector": 2, "depthcn": 4, "fusion LM": 1, "fusion LBFGS": 1, "fusion AdamW": 4}
# Two processes of the fusion sum their halves of a batch, in another order than one process.
SHARES_BATCHES = ("fusion LM", "fusion LBFGS", "fusion AdamW")
# Pictures over and over, of which each process gets a half.
SHARED = ("--data.count=4", "--data.repeats=16", "--optimizer.lr=0.02", "--model.scales=[1.0,1.0]")


@pytest.fixture(scope="module")
def words(tmp_path_factory) -> dict[str, list[str]]:
    """Return the flags of each training, on frames with cars and with the same bodies of another class."""
    folder = tmp_path_factory.mktemp("drives")
    write_car_frames(folder / "cars", frames=6)
    write_car_frames(folder / "others", frames=4, kind="Pedestrian")
    drives = json.dumps([str(folder / "cars"), str(folder / "others")])
    crops = [f"--data.drives={drives}", f"--data.cache={folder / 'cache'}", "--data.batch_size=8"]
    # What is dropped is drawn differently in each process.
    return {
        "detector": [*TINY],
        "depthcn": [*crops, "--data.shares=[60,40]", "--model.dropout=0"],
        "fusion LM": toy_words(LM, EPOCHS),
        "fusion LBFGS": toy_words("LBFGS", EPOCHS, "--optimizer.line_search_fn=strong_wolfe"),
        "fusion AdamW": toy_words("AdamW", EPOCHS),
    }


@pytest.fixture(scope="module")
def trained(words, tmp_path_factory) -> Path:
    """Return a folder with every training: whole, killed and resumed, and by two processes."""
    folder, jobs = tmp_path_factory.mktemp("trained"), []
    random = np.random.default_rng(0)
    for name, flags in words.items():
        kind = name.split()[0]
        out = {way: str(folder / name / way) for way in ("whole", "resumed", "together")}
        killed_after = int(random.integers(BATCHES[name], EPOCHS * BATCHES[name]))
        sees_all = name not in SHARES_BATCHES
        jobs += [
            Job(kind, out["whole"], flags, EPOCHS),
            Job(kind, out["resumed"], flags, EPOCHS, killed_after=killed_after),
            Job(kind, out["resumed"], flags, EPOCHS, resumes=True),
            Job(kind, out["together"], flags, EPOCHS, processes=2, sees_all=sees_all),
        ]
    shared = {kind: str(folder / kind / "shared") for kind in ("detector", "depthcn")}
    by_lightning = [*words["depthcn"], LOGGED]
    jobs += [
        Job("detector", shared["detector"], [*words["detector"], *SHARED], 2, processes=2),
        Job("depthcn", shared["depthcn"], by_lightning, 1, processes=2, started_by="lightning"),
    ]
    halves = [*words["detector"], "--model.network=tiny-without-batch-norm"]
    for processes, batch in ((1, 4), (2, 2)):
        out = str(folder / "detector" / f"by {processes}")
        flags = [*halves, f"--data.batch={batch}"]
        jobs.insert(0, Job("detector", out, flags, EPOCHS, processes=processes))
    codes = run_jobs(jobs, folder)
    logs = [(folder / f"{number}.log").read_text() for number in range(len(jobs))]
    assert codes == [
        [0, 0],
        [0],
        *([[0], [-signal.SIGKILL], [0], [0, 0]] * len(words)),
        [0, 0],
        [0],
    ], logs
    return folder


@pytest.mark.parametrize("name", BATCHES)
@pytest.mark.parametrize("way", ["resumed", "together"])
def test_the_result_is_that_of_one_uninterrupted_process(trained, name, way):
    folders = [trained / name / one for one in ("whole", way)]
    whole, other = (read_checkpoint(one / "last.ckpt", name.split()[0]) for one in folders)
    assert (whole["epoch"], whole["global_step"]) == (EPOCHS - 1, EPOCHS * BATCHES[name])
    tolerance = 1e-5 if way == "together" and name in SHARES_BATCHES else 0
    for part in ("state_dict", "current_model_state"):
        assert whole.get(part, {}).keys() == other.get(part, {}).keys()
        for key, weight in whole.get(part, {}).items():
            torch.testing.assert_close(
                other[part][key], weight, rtol=tolerance, atol=tolerance, msg=key
            )
    for key in ("epoch", "global_step", "lr_schedulers"):
        assert other[key] == whole[key]
    metrics = [
        {**json.loads((one / "metrics.json").read_text()), "checkpoint": None} for one in folders
    ]
    assert metrics[0] == metrics[1]


def test_two_processes_of_a_detector_train_as_one_with_batches_of_twice_the_size(trained):
    one, two = (
        read_checkpoint(trained / "detector" / f"by {processes}" / "last.ckpt", MODEL)
        for processes in (1, 2)
    )
    assert one["global_step"] == two["global_step"] == EPOCHS * BATCHES["detector"]
    for key, weight in one["state_dict"].items():
        torch.testing.assert_close(two["state_dict"][key], weight, rtol=1e-4, atol=1e-5, msg=key)


def test_processes_of_a_detector_share_the_batches_and_measure_what_all_have_seen(
    trained, monkeypatch
):
    monkeypatch.setitem(networks.NETWORKS, "tiny", tiny_network)
    file = trained / "detector/shared/last.ckpt"
    (detector, _), saved = load_detector(file), read_checkpoint(file, MODEL)
    assert saved["global_step"] == 2 * 16 / 2
    # Both saw every picture; a measure that counted them twice would call every second detection wrong.
    samples, boxes = ToyImages(4, repeats=1).training, ValidationBoxes(("Car",))
    for row in range(len(samples)):
        with torch.inference_mode():
            decoded = detector.decode(detector(samples[row]["images"][None]))
        seen = postprocess_detections(*(part[0].numpy() for part in decoded), ("Car",), SIZE)
        boxes.update([seen], torch.tensor([row]), process=0)
    found = boxes.gathered([samples.placement(0)] * len(samples))
    alone = precision_table(measure(samples.truth(), found, len(samples), ("Car",)))
    for name, of_difficulty in alone.items():
        assert saved["precision"][name] == pytest.approx(of_difficulty, abs=0.01)
    assert alone["Car 0.5"]["moderate"] > 1


def test_lightning_starts_the_second_process_and_the_first_one_reports(trained):
    (log,) = sorted(trained.glob("*.log"), key=lambda file: int(file.stem))[-1:]
    assert log.read_text().count(" steps") == 1
    assert "Warning" not in log.read_text()
    assert "recommended" not in log.read_text()
    out = trained / "depthcn/shared"
    assert read_checkpoint(out / "last.ckpt", "depthcn")["global_step"] == BATCHES["depthcn"] // 2
    accuracy = json.loads((out / "metrics.json").read_text())["parts"]["validation"]["accuracy"]
    assert 0 <= accuracy <= 1
