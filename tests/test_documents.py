"""Every command that the documents name exists, with the flags that they give it."""

import re
from functools import cache
from pathlib import Path

import pytest

from perception.cli.batch import parse_batch
from perception.cli.main import COMMANDS, GROUPS, BatchCommand, TrainingCommand
from perception.cli.parser import parse
from perception.cli.train import parse as parse_training
from perception.errors import PerceptionError, UsageError
from train.trainings import training_of

ROOT = Path(__file__).parents[1]
DOCUMENTS = (
    "README.md",
    *(
        f"docs/{page.relative_to(ROOT / 'docs')}"
        for page in sorted((ROOT / "docs").rglob("*.md"))
        if page.name != "thesis.md"  # which has a test of its own
    ),
    "perception/detection/weights/README.md",
    "Makefile",
)


# Of the loops of make's recipes, one value.
_OF_LOOPS = {
    "modality": "dm",
    "sensor": "HDL-64E",
    "file": "HDL-64E",
    "seed": "1",
    "street": "town",
}


def commands(document: str) -> list[str]:
    text = (ROOT / document).read_text().replace("\\\n", " ").replace("$(BIN)/", "")
    # Of make's conditions, what holds where nothing is set.
    text = re.sub(r"\$\(or \$\(\w+\),([^)]*)\)", r"\1", text)
    text = re.sub(r"\$\(if \$\(\w+\),[^,)]*,?([^)]*)\)", r"\1", text)
    found = re.findall(r"(?:^|`|\s)(trifuse [a-z][^`\n|&]*)", text)
    return [re.sub(r"\$\$(\w+)", lambda name: _OF_LOOPS[name[1]], command) for command in found]


@cache
def fault_of(line: str) -> PerceptionError | None:
    """Return the error by which a command is refused before it runs."""
    printing = ("--help", "--help-all", "--print-config")
    words = [word for word in line.split()[1:] if word not in printing]
    name = next((n for n in (" ".join(words[:2]), words[0]) if n in COMMANDS), None)
    if name is None:
        is_group = words[1:] == [] and words[0] in GROUPS
        return None if is_group else UsageError(line, expected="a command", found="none")
    try:
        parse_words(name, words[len(name.split()) :])
    except PerceptionError as error:
        return error
    return None


def parse_words(name: str, words: list[str]) -> None:
    command = COMMANDS[name]
    if isinstance(command, TrainingCommand):
        parse_training(training_of(command.target, words), words)
    elif isinstance(command, BatchCommand):
        of_drive, rest = command.of_drive(name, words)
        parse_batch(command.load(), of_drive, COMMANDS[of_drive].load(), rest)
    else:
        parse(f"trifuse {name}", command.load(), words)


@pytest.mark.parametrize("document", DOCUMENTS)
def test_commands_of_documents_can_be_parsed(document):
    faults = [fault_of(command) for command in dict.fromkeys(commands(document))]
    # A text names commands without their drives, and files that a run leaves; what `make` runs is whole.
    known = [
        fault
        for fault in faults
        if fault is not None and fault.found != "nothing" and "config.yaml" not in fault.where
    ]
    assert known == []
    assert document != "Makefile" or faults == [None] * len(faults)


def test_the_makefile_trains_measures_and_exports_every_network():
    starts = {" ".join(command.split()[1:3]) for command in commands("Makefile")}
    assert {"train detector", "train fusion", "train depthcn", "evaluate detection"} <= starts


def test_an_unknown_flag_value_or_command_would_be_seen():
    assert fault_of("trifuse run DRIVE --framez 3 --no-video").found == "--framez"
    assert fault_of("trifuse run DRIVE --frames many").where == "--frames"
    assert fault_of("trifuse fly").expected == "a command"
    assert fault_of("trifuse run").found == "nothing"
