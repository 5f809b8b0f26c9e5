"""Words of a command line become names and values."""

from pathlib import Path

import pytest

from perception.cli.words import read_words

TYPES = {
    "drive": Path,
    "frames": int,
    "on_bad_frame": str,
    "iou": tuple[float, ...],
    "names": list[str],
    "video": bool,
    "model": object,
    "pipeline.parallel": bool,
    "pipeline.motion.voxel_size_m": float,
}


@pytest.mark.parametrize(
    ("words", "values"),
    [
        (["--on-bad-frame", "skip"], [("on_bad_frame", "skip")]),
        (["--video"], [("video", "true")]),
        (["--video", "false"], [("video", "false")]),
        (["--no-video", "a"], [("drive", "a"), ("video", "false")]),
        (["--iou=0.7,0.5"], [("iou", "[0.7,0.5]")]),
        (["--iou", "[0.7]"], [("iou", "[0.7]")]),
        (["--names", ""], [("names", "[]")]),
        (["--frames", "-3", "a"], [("drive", "a"), ("frames", "-3")]),
        (["--pipeline.no-parallel"], [("pipeline.parallel", "false")]),
        (["--pipeline.motion", "motion.yaml"], [("pipeline.motion", "motion.yaml")]),
        (["--pipeline.motion.voxel", "1"], [("pipeline.motion.voxel_size_m", "1")]),
        (["--names+=b"], [("names+", '["b"]')]),
        (
            ["--model", "Net", "--model.layer-count=3"],
            [("model", "Net"), ("model.layer_count", "3")],
        ),
    ],
)
def test_words_become_names_and_values(words, values):
    assert read_words("trifuse do", words, TYPES, ["drive"]) == values


def test_a_list_takes_all_words_that_are_left():
    types = {"first": str, "drives": list[Path], "frames": int}
    words = ["a", "b", "--frames", "3", "c"]
    assert read_words("trifuse do", words, types, ["first", "drives"]) == [
        ("first", "a"),
        ("drives", '["b", "c"]'),
        ("frames", "3"),
    ]
