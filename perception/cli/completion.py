"""`trifuse completion`."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

from perception.cli.words import flag_words
from perception.errors import PerceptionError

if TYPE_CHECKING:  # the list of commands names this module
    from perception.cli.main import Command

Shell = Literal["bash", "zsh"]


def completion(shell: Shell = "bash") -> None:
    """Print a script that completes commands, flags, choices and files in a shell.

    Example: trifuse completion bash > ~/.local/share/bash-completion/completions/trifuse

    Args:
        shell: Shell that reads the script.
    """
    import shtab

    print(shtab.complete(_command_tree(), shell))


def _command_tree() -> argparse.ArgumentParser:
    """Return all commands with the flags that `--help` lists, as a tree of plain parsers."""
    from perception.cli.main import COMMANDS, GROUPS, SUMMARIES

    tree = argparse.ArgumentParser(prog="trifuse")
    branches = {"": tree.add_subparsers()}
    for group in GROUPS:
        branch = branches[""].add_parser(group, help=SUMMARIES[group], add_help=False)
        branches[group] = branch.add_subparsers()
    for name, command in COMMANDS.items():
        group, _, last = name.rpartition(" ")
        leaf = branches[group].add_parser(last, help=command.summary, add_help=False)
        for flag, kind in _flags(command):
            _add_flag(leaf, flag, kind)
    return tree


def _flags(command: "Command") -> Iterator[tuple[str, Any]]:
    """Yield each argument and flag that `--help` lists, with its type; none of a command that is not installed."""
    try:
        types, places = command.flags(), command.places()
    except PerceptionError:  # of benchmarks/, which a wheel does not hold
        return
    for name, kind in types.items():
        if "." not in name:
            yield (name if name in places else flag_words(name), kind)


def _add_flag(leaf: argparse.ArgumentParser, flag: str, kind: Any) -> None:  # noqa: ANN401 - any annotation
    """Add a flag, or an argument where the name has no dashes, with its choices, or files as values."""
    import shtab

    if kind is bool:
        leaf.add_argument(flag, action="store_true")
        return
    choices = [str(one) for one in get_args(kind)] if get_origin(kind) is Literal else None
    value: Any = leaf.add_argument(flag, choices=choices)
    if kind in (Path, list[Path]):
        value.complete = shtab.FILE
