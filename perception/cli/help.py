"""Help of a command: flags as they are typed, with their values and defaults."""

import argparse
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal, get_args, get_origin


def help_formatter(
    types: Mapping[str, Any], places: Sequence[str], summary: str
) -> type[argparse.HelpFormatter]:
    """Return the class that formats the help of a command.

    Args:
        types: Type of each flag by its full name.
        places: Names of the positional arguments.
        summary: First line of the command's docstring.
    """
    attributes = {"types": types, "places": places, "summary": summary.rstrip(".")}
    return type("CommandHelp", (_Help,), attributes)


class _Help(argparse.RawDescriptionHelpFormatter):
    types: ClassVar[Mapping[str, Any]] = {}
    places: ClassVar[Sequence[str]] = ()
    summary: ClassVar[str] = ""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=34, width=110)

    def start_section(self, heading: str | None) -> None:
        """Name the sections by what they hold; jsonargparse takes the first line of a docstring."""
        names = {self.summary: "Arguments", "options": "Configuration"}
        super().start_section(names.get(heading or "", heading))

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return "\n".join(textwrap.fill(line, width) for line in text.split("\n"))

    def _format_action_invocation(self, action: argparse.Action) -> str:
        if action.dest in self.places:
            return place_words(action.dest, self.types[action.dest])
        if _is_print_config(action):
            return "--print-config"
        flag = max(action.option_strings, key=len).removesuffix("+").replace("_", "-")
        if isinstance(action.default, bool):
            head, dot, name = flag[2:].rpartition(".")
            return f"--{head}{dot}[no-]{name}"
        return f"{flag} {_metavar(self.types.get(action.dest, Path))}"

    def _expand_help(self, action: argparse.Action) -> str:
        """Return the help as it is: docstrings hold percent signs."""
        if _is_print_config(action):
            return "Print the effective configuration as YAML and exit."
        text = action.help or ""
        if text == "Path to a configuration file.":
            return "YAML file with this section."
        if isinstance(action.default, bool):
            return f"{text} [{'on' if action.default else 'off'}]"
        if action.default in (None, argparse.SUPPRESS, "", ()):
            return text
        return f"{text} [{_shown(action.default)}]"


def item_type(kind: Any) -> Any | None:  # noqa: ANN401 - any annotation
    """Return the type of a list's items, or None of what is no list."""
    return get_args(kind)[0] if get_origin(kind) in (list, tuple) else None


def place_words(name: str, kind: Any) -> str:  # noqa: ANN401 - any annotation
    """Return a positional argument as the help shows it."""
    return name.upper() if item_type(kind) is None else f"{name.upper()} ..."


def type_words(kind: Any) -> str:  # noqa: ANN401 - any annotation
    """Return a type in words for a person."""
    if get_origin(kind) is Literal:
        return "one of " + ", ".join(map(str, get_args(kind)))
    if (item := item_type(kind)) is not None:
        return f"{type_words(item)}, several with commas between them"
    words = {
        int: "a whole number",
        float: "a number",
        bool: "true or false",
        str: "a word",
        Path: "a path",
    }
    return words.get(kind, "a value")


def _is_print_config(action: argparse.Action) -> bool:
    return any(flag.startswith("--print_config") for flag in action.option_strings)


def _metavar(kind: Any) -> str:  # noqa: ANN401 - any annotation
    if get_origin(kind) is Literal:
        return f"{{{','.join(map(str, get_args(kind)))}}}"
    if (item := item_type(kind)) is not None:
        return f"{_metavar(item)},..."
    return {int: "N", float: "X", Path: "PATH"}.get(kind, "TEXT")


def _shown(value: object) -> str:
    if isinstance(value, list | tuple):
        return ",".join(map(str, value))
    return f"{value:g}" if isinstance(value, float) else str(value)
