"""Flags from the signature of a function: values, YAML files, help, and errors."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest

from data.results.command_config import CommandConfig
from perception.cli.parser import (
    FlagGroup,
    call,
    help_text,
)
from perception.errors import UsageError
from tests.faults import fault


@dataclass(frozen=True)
class Shared(FlagGroup):
    """Shared flags.

    Attributes:
        frames: Number of frames.
        mode: Mode of reading.
    """

    frames: int | None = None
    mode: Literal["stop", "skip"] = "stop"


@dataclass(frozen=True)
class Motion:
    """Motion.

    Attributes:
        voxel_size_m: Edge of a voxel in metres; 5 % of the area.
        parallel: Whether it runs in parallel.
    """

    voxel_size_m: float = 0.1
    parallel: bool = True


@dataclass(frozen=True)
class Pipeline:
    """Pipeline.

    Attributes:
        motion: Motion of points.
    """

    motion: Motion = field(default_factory=Motion)


CALLS = []
_PIPELINE, _MOTION = Pipeline(), Motion()


def command(  # noqa: D417 - a FlagGroup documents itself
    drive: Path,
    *,
    shared: Shared,
    iou: tuple[float, ...] = (0.7, 0.5),
    names: list[str] | None = None,
    video: bool = True,
    pipeline: Pipeline = _PIPELINE,
) -> None:
    """Do something with a drive.

    A second paragraph.

    Example: trifuse do kitti --iou 0.5

    Args:
        drive: Drive to read.
        iou: Overlaps.
        names: Names of methods.
        video: Draw the video.
        pipeline: Pipeline configuration.
    """
    CALLS.append((drive, shared, iou, names, video, pipeline))


def several(drives: list[Path], *, out: Path = Path("out")) -> None:
    """Do something with several drives.

    Args:
        drives: Drives to read.
        out: Folder for the results.
    """
    CALLS.append((drives, out))


def writing(drive: Path, *, config: CommandConfig, out: Path | None = None) -> None:  # noqa: D417 - no flag
    """Do something and write it.

    Args:
        drive: Drive to read.
        out: Folder for the results.
    """
    CALLS.append((out, config))


def called(*words: str, function=command):
    CALLS.clear()
    call("trifuse do", function, words)
    return CALLS.pop()


def refused(*words: str) -> tuple[str, str, str]:
    with pytest.raises(UsageError) as caught:
        call("trifuse do", command, words)
    error = caught.value
    assert error.advice == "see trifuse do --help"
    return error.where, error.expected, error.found


def test_defaults_are_those_of_the_signature():
    assert called("a") == (Path("a"), Shared(), (0.7, 0.5), None, True, Pipeline())


def test_every_kind_of_flag_reaches_the_function():
    words = ("--frames", "3", "--iou", "0.5,0.25", "--names", "x,y", "--no-video", "--mode", "skip")
    nested = ("--pipeline.motion.voxel-size", "0.2", "--pipeline.motion.no-parallel")
    assert called("a", *words, *nested) == (
        Path("a"),
        Shared(3, "skip"),
        (0.5, 0.25),
        ["x", "y"],
        False,
        Pipeline(Motion(0.2, parallel=False)),
    )


def test_several_words_fill_a_positional_list():
    assert called("a", "b", "--out", "o", function=several) == ([Path("a"), Path("b")], Path("o"))


def test_a_file_gives_values_and_flags_behind_it_win(tmp_path):
    file = tmp_path / "flags.yaml"
    file.write_text("frames: 5\nvideo: false\npipeline:\n  motion:\n    voxel_size_m: 0.3\n")
    _, shared, _, _, video, pipeline = called("a", "--config", str(file), "--frames", "7")
    assert (shared.frames, video, pipeline.motion.voxel_size_m) == (7, False, 0.3)


def test_what_is_typed_wins_over_a_file_wherever_it_stands(tmp_path):
    file = tmp_path / "flags.yaml"
    file.write_text("frames: 5\n")
    assert called("a", "--frames", "7", "--config", str(file))[1].frames == 7


def test_a_file_of_a_section_gives_its_values(tmp_path):
    file = tmp_path / "motion.yaml"
    file.write_text("voxel_size_m: 0.3\n")
    words = ["--pipeline.motion", str(file), "--pipeline.motion.no-parallel"]
    assert called("a", *words)[-1] == Pipeline(Motion(0.3, parallel=False))


def test_a_command_gets_its_configuration_without_its_outputs():
    assert called("a", "--out", "o", function=writing) == (
        Path("o"),
        CommandConfig("do", {"drive": Path("a")}),
    )


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ([], ("command line", "DRIVE", "nothing")),
        (["a", "b"], ("command line", "a flag", "b")),
        (["a", "--frams", "3"], ("command line", "a flag such as --frames", "--frams")),
        (["a", "--frames"], ("--frames", "a whole number", "no value")),
        (["a", "--frames", "x"], ("--frames", "a whole number", "x")),
        (["a", "--mode", "go"], ("--mode", "one of stop, skip", "go")),
        (["a", "--video=maybe"], ("--video", "true or false", "maybe")),
        (
            ["a", "--iou", "0.5,x"],
            ("--iou", "a number, several with commas between them", "x"),
        ),
        (
            ["a", "--pipeline.motion.voxel-size", "x"],
            ("--pipeline.motion.voxel-size-m", "a number", "x"),
        ),
    ],
)
def test_what_cannot_be_parsed_is_one_sentence(words, error):
    assert refused(*words) == error


def test_files_that_cannot_be_used_are_named(tmp_path):
    file = tmp_path / "flags.yaml"
    with fault(UsageError, f"--config {file}", "a YAML file", "No such file"):
        called("a", "--config", str(file))
    file.write_text("framez: 3\n")
    keys = "keys that are flags of trifuse do, such as "
    with fault(UsageError, f"--config {file}", f"{keys}frames", "framez"):
        called("a", "--config", str(file))
    file.write_text("pipeline:\n  motion:\n    voxel_siz_m: 0.3\n")
    found = "pipeline.motion.voxel_siz_m"
    with fault(UsageError, f"--config {file}", f"{keys}pipeline.motion.voxel_size_m", found):
        called("a", "--config", str(file))
    removed = "".join(f"    constant_{number}: 1\n" for number in range(5))
    file.write_text(f"pipeline:\n  motion:\n{removed}frames: 3\n")
    motion = "pipeline.motion.constant_"
    advice = (
        "remove these keys; a parameter of an older version may be a constant of the method now"
    )
    with fault(UsageError, found=f"{motion}0, {motion}1, {motion}2 and 2 more", advice=advice):
        called("a", "--config", str(file))


def test_help_shows_values_switches_defaults_and_the_example():
    lines = [line.strip() for line in help_text("do", command, everything=False).splitlines()]
    assert lines[0] == "usage: do DRIVE [flags]"
    words = {tuple(line.split("  ")[0].split()): line for line in lines}
    assert words[("--mode", "{stop,skip}")].endswith("[stop]")
    assert words[("--iou", "X,...")].endswith("[0.7,0.5]")
    assert words[("--[no-]video",)].endswith("Draw the video. [on]")
    assert words[("--frames", "N")].endswith("Number of frames.")
    assert lines[-1] == "Example: trifuse do kitti --iou 0.5"
    assert not any("voxel" in line for line in lines)


def test_all_help_lists_the_nested_flags():
    text = help_text("do", command, everything=True)
    assert "--pipeline.motion.voxel-size-m X" in text
    assert "5 % of the area. [0.1]" in text
    assert "--pipeline.motion.[no-]parallel" in text
