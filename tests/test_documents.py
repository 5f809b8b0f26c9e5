"""Every command that the documents name exists, with the flags that they give it."""

import re
from pathlib import Path

import pytest

from perception.cli.main import COMMANDS
from perception.cli.parser import flag_types

ROOT = Path(__file__).parents[1]
DOCUMENTS = (
    "README.md",
    "docs/architecture.md",
    "docs/benchmark.md",
    "perception/detection/weights/README.md",
    "Makefile",
)


def commands(document: str) -> list[str]:
    text = (ROOT / document).read_text().replace("\\\n", " ").replace("$(BIN)/", "")
    return re.findall(r"(?:^|`|\s)(trifuse [a-z][^`\n|&]*)", text)


def unknown_flags(command: str) -> list[str]:
    words = command.split()[1:]
    name = next((n for n in (" ".join(words[:2]), words[0]) if n in COMMANDS), None)
    if name is None:
        return [] if words[1:] == ["--help"] else [command]
    types = flag_types(COMMANDS[name].load())
    flags = [word[2:].partition("=")[0].replace("-", "_") for word in words if word[:2] == "--"]
    return [
        flag
        for flag in flags
        if flag not in ("help", "help_all", "config")
        and flag.removeprefix("no_") not in types
        and not any(known.startswith(f"{flag}_") for known in types)
    ]


@pytest.mark.parametrize("document", DOCUMENTS)
def test_commands_of_documents_exist(document):
    faults = {
        command: unknown for command in commands(document) if (unknown := unknown_flags(command))
    }
    assert faults == {}


def test_an_unknown_flag_or_command_would_be_seen():
    assert unknown_flags("trifuse run DRIVE --framez 3 --no-video") == ["framez"]
    assert unknown_flags("trifuse fly") == ["trifuse fly"]
