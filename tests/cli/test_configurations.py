"""What a command writes as its configuration is what `--config` reads."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from perception.cli.main import COMMANDS, run_command_line
from perception.cli.parser import call, flag_types, parse

# Words that a command demands: of inputs, and of outputs, which are no part of a configuration.
INPUTS = {
    "evaluate results": "x --labels y",
    "train detector": "x --modality dm",
    **dict.fromkeys(("study reflectance-maps", "study detector-losses"), "x --validation y"),
    "study sim-to-real": "x --validation y",
    **dict.fromkeys(("demo", "synth", "bench"), ""),
    **dict.fromkeys(("study ins-error", "study sensors", "study single-object"), ""),
}
OUTPUTS = {"synth": "out", "export": "--out out", "split": "--out out"}


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


@pytest.mark.parametrize("name", COMMANDS)
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
