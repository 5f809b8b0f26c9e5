"""What a command writes as its configuration is what `--config` reads."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from perception.cli import train
from perception.cli.main import COMMANDS, TrainingCommand, run_command_line
from perception.cli.parser import call, flag_types, parse
from train.trainings import TRAININGS

# Words that a command demands: of inputs, and of outputs, which are no part of a configuration.
INPUTS = {
    "evaluate results": "x --labels y",
    **dict.fromkeys(("study reflectance-maps", "study detector-losses"), "x --validation y"),
    "study sim-to-real": "x --validation y",
    **dict.fromkeys(("demo", "synth", "batch synth", "bench", "completion"), ""),
    **dict.fromkeys(("study ins-error", "study sensors", "study single-object"), ""),
    **dict.fromkeys(
        ("study growth", "study thesis", "study uncertainty", "study false-movers", "study jams"),
        "",
    ),
    "study motion-scenes": "",
}
OUTPUTS = {
    "synth": "out",
    **dict.fromkeys(("adapt", "export", "split", *(one for one in COMMANDS if one.startswith("batch "))), "--out out"),
    "batch synth": "out",
    "shards": "--out out --modality dm",
}  # fmt: skip


def section_flags(types: dict[str, object], values: dict[str, object]) -> Iterator[str]:
    """Yield one flag of each section with its default."""
    done = set()
    for flag in types:
        *sections, last = flag.split(".")
        value = values
        for section in sections:
            value = value[section]
        if sections and tuple(sections) not in done and value[last] is not None:
            done.add(tuple(sections))
            default = value[last]
            words = ",".join(map(str, default)) if isinstance(default, list) else default
            yield f"--{flag}={str(words).lower() if isinstance(words, bool) else words}"


@pytest.mark.parametrize(
    "name", [name for name, one in COMMANDS.items() if not isinstance(one, TrainingCommand)]
)
def test_the_configuration_of_every_command_is_read_back(name, tmp_path):
    function, outputs = COMMANDS[name].load(), OUTPUTS.get(name, "").split()
    words = INPUTS.get(name, "x").split() + outputs
    arguments, config = parse(name, function, words)
    file = tmp_path / "config.yaml"
    config.write(tmp_path)
    assert parse(name, function, ["--config", str(file), *outputs]) == (arguments, config)
    # A flag of a section leaves the others as they are.
    flags = section_flags(flag_types(function), yaml.safe_load(file.read_text()))
    assert parse(name, function, [*words, *flags])[0] == arguments


WORDS = {"detector": ["--modality", "dm"]}


@pytest.mark.parametrize("kind", TRAININGS)
def test_the_configuration_of_every_training_is_read_back(kind, tmp_path):
    words = [*WORDS.get(kind, []), "x", "--validation", "y", "--epochs", "3"]
    *_, cli = train.parse(kind, words)
    cli.command_config.write(tmp_path)
    *_, again = train.parse(kind, ["--config", str(tmp_path / "config.yaml")])
    assert again.command_config == cli.command_config


@pytest.mark.parametrize("kind", TRAININGS)
def test_the_shipped_defaults_are_those_of_the_flags(kind):
    words = WORDS.get(kind, [])
    *_, cli = train.parse(kind, words)
    *_, shipped = train.parse(kind, ["--config", "default", *words])
    assert shipped.command_config == cli.command_config


def test_a_configuration_is_printed(capsys):
    call("trifuse synth", COMMANDS["synth"].load(), ["out", "--frames", "3", "--print-config"])
    printed = yaml.safe_load(capsys.readouterr().out)
    assert (printed["frames"], printed["layout"]) == (3, "raw")
    assert "out" not in printed


def files(folder: Path) -> dict[str, bytes]:
    return {
        str(file.relative_to(folder)): file.read_bytes()
        for file in folder.rglob("*")
        if file.is_file()
    }


def test_a_configuration_repeats_every_byte(tmp_path):
    first, second, config = tmp_path / "first", tmp_path / "second", "config.yaml"
    words = ["--frames", "2", "--layout", "tracking", "--seed", "3", "--sensor", "VLP-16"]
    run_command_line(["synth", str(first), *words])
    run_command_line(["synth", str(second), "--config", str(first / config)])
    assert files(second) == files(first)
    maps, again = tmp_path / "maps", tmp_path / "again"
    run_command_line(["maps", str(first), "--method", "thesis", "--all", "--out", str(maps)])
    run_command_line(["maps", "--config", str(maps / config), "--out", str(again)])
    assert files(again) == files(maps)
