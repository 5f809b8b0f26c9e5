"""From a function's signature to the flags of a command, and from words to a call.

A command is a function. Its positional parameters are positional arguments, its keyword-only parameters are flags, and its docstring
is the help. A parameter whose type is a `FlagGroup` becomes flat flags under a heading of their own; a parameter whose type is any
other dataclass becomes nested flags, such as `--pipeline.motion.voxel-size 0.2`, and a section of a YAML file for `--config`.
A parameter whose type is `CommandConfig` is no flag: it gets the effective values of all others, in the form that `--config` reads.
"""

import argparse
import dataclasses
import inspect
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import NoneType
from typing import Any, get_args, get_type_hints

from jsonargparse import ArgumentParser, Namespace

from data.results.command_config import CommandConfig, read_known
from perception.atomic_file import require_writable
from perception.cli.help import help_formatter, place_words
from perception.cli.words import flag_words, read_words, usage_error
from perception.errors import UsageError

CommandFunction = Callable[..., None]

_OUTPUT_FILES = {"json", "html", "plot", "reliability_plot", "nuscenes", "rerun"}
# Flags that name outputs, or what happens to earlier ones; they belong to no configuration.
_OUTPUTS = {
    *_OUTPUT_FILES, "counting_sheet", "out", "overwrite", "plots", "resume", "runs", "stages", "view",
    "worst_frames",
}  # fmt: skip
PRINT_CONFIG = {"--print-config", "--print_config"}


class FlagGroup:
    """Base of the dataclasses whose fields become flat flags of every command that takes one."""


def call(prog: str, function: CommandFunction, words: Sequence[str]) -> None:
    """Parse the words of a command line and call the function, or print its configuration.

    Raises:
        UsageError: A flag is unknown, or its value is not of its type.
        WriteError: A file that is asked for could not be written.
    """
    asked = [word for word in words if word not in PRINT_CONFIG]
    arguments, config = parse(prog, function, asked)
    if len(asked) < len(words):
        print(config.text(), end="")
        return
    for flag, value in _flat_values(function, arguments):
        if flag in _OUTPUT_FILES and value is not None:
            require_writable(value)
    hints = get_type_hints(function)
    function(**arguments, **{name: config for name, kind in hints.items() if kind is CommandConfig})


def parse(
    prog: str, function: CommandFunction, words: Sequence[str]
) -> tuple[dict[str, Any], CommandConfig]:
    """Return the arguments that the words of a command line give a function, and the same as a configuration.

    Raises:
        UsageError: A flag is unknown, or its value is not of its type.
    """
    types, places = flag_types(function), positional(function)
    given = read_words(prog, words, types, places)
    files = [Path(value) for name, value in given if name == "config"]
    configs = [read_known(file, prog, types) for file in files]
    flags = [(name, value) for name, value in given if name != "config"]
    parser = build_parser(prog, function)
    try:
        read = [f"--config={json.dumps(config)}" for config in configs]
        parsed = parser.parse_args([*read, *(f"--{name}={value}" for name, value in flags)])
    except argparse.ArgumentError as error:
        raise usage_error(prog, str(error), types, places) from error
    arguments = _arguments(function, parser.instantiate(parsed))
    for name in places:
        if arguments[name] == []:
            raise UsageError(name.upper(), expected="at least one", found="none")
    values = {
        name: value for name, value in _flat_values(function, arguments) if name not in _OUTPUTS
    }
    return arguments, CommandConfig(prog.removeprefix("trifuse "), values)


def help_text(prog: str, function: CommandFunction, *, everything: bool) -> str:
    """Return the help of a command.

    Args:
        prog: Words that call the command.
        function: The command.
        everything: Whether the nested flags are listed too.
    """
    _, nested = _sections(function)
    parser = build_parser(prog, function, skip=() if everything else tuple(nested))
    return parser.format_help().rstrip()


@cache
def build_parser(
    prog: str, function: CommandFunction, *, skip: tuple[str, ...] = ()
) -> ArgumentParser:
    """Return the parser of a command.

    Args:
        prog: Words that call the command.
        function: The command.
        skip: Sections that get no flags; the help names them.
    """
    summary, example = _summary_and_example(function)
    parser = ArgumentParser(
        prog=prog,
        usage=_usage(prog, function),
        description=summary,
        formatter_class=help_formatter(
            flag_types(function), positional(function), summary.partition("\n")[0]
        ),
        exit_on_error=False,
        allow_abbrev=False,
        add_help=False,
    )
    parser.add_argument("--config", action="config", help="YAML file with values of flags.")
    groups, _ = _sections(function)
    is_flag = _hints(function)
    injected = {name for name in inspect.signature(function).parameters if name not in is_flag}
    parser.add_function_arguments(function, skip={*groups, *injected, *skip}, fail_untyped=True)
    for kind in groups.values():
        parser.add_class_arguments(kind, nested_key=None)
    sections = ", ".join(f"{flag_words(name)}.*" for name in skip)
    note = f"{sections}: parameters of the method, listed by --help-all." if skip else None
    parser.epilog = "\n".join(filter(None, [note, example]))
    return parser


def flag_types(function: CommandFunction) -> dict[str, Any]:
    """Return the type of each flag by its full name, nested ones with dots."""
    return dict(nested_types(_hints(function)))


def nested_types(hints: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield full name and type of each flag that parameters become, of dataclasses each field.

    Args:
        hints: Type of each parameter by its name.
        prefix: Section of the flags, such as `data.`.
    """
    for name, hint in hints.items():
        kind = _without_none(hint)
        if isinstance(kind, type) and dataclasses.is_dataclass(kind):
            inner = prefix if issubclass(kind, FlagGroup) else f"{prefix}{name}."
            hints_of_kind = get_type_hints(kind)
            fields = {one.name: hints_of_kind[one.name] for one in dataclasses.fields(kind)}
            yield from nested_types(fields, inner)
        else:
            yield f"{prefix}{name}", kind


def _flat_values(
    function: CommandFunction, arguments: Mapping[str, Any]
) -> Iterator[tuple[str, Any]]:
    """Yield the value of each argument and flag."""
    flat = _sections(function)[0]
    for name, value in arguments.items():
        yield from vars(value).items() if name in flat else [(name, value)]


def _sections(function: CommandFunction) -> tuple[dict[str, type], dict[str, type]]:
    """Return the parameters that become flat flags, and those that become nested ones."""
    kinds = {name: _without_none(hint) for name, hint in _hints(function).items()}
    sections: dict[str, type] = {
        name: kind
        for name, kind in kinds.items()
        if isinstance(kind, type) and dataclasses.is_dataclass(kind)
    }
    flat = {name: kind for name, kind in sections.items() if issubclass(kind, FlagGroup)}
    return flat, {name: kind for name, kind in sections.items() if name not in flat}


def _hints(function: CommandFunction) -> dict[str, Any]:
    """Return the type of each parameter that becomes an argument or flags."""
    hints = get_type_hints(function)
    names = inspect.signature(function).parameters
    return {name: hints[name] for name in names if hints[name] is not CommandConfig}


def positional(function: CommandFunction) -> list[str]:
    """Return the names of the positional arguments."""
    parameters = inspect.signature(function).parameters.values()
    return [one.name for one in parameters if one.kind is not one.KEYWORD_ONLY]


def _without_none(kind: Any) -> Any:  # noqa: ANN401 - any annotation
    members = [member for member in get_args(kind) if member is not NoneType]
    is_optional = len(members) < len(get_args(kind)) and len(members) == 1
    return members[0] if is_optional else kind


def _arguments(function: CommandFunction, parsed: Namespace) -> dict[str, Any]:
    """Return what the function is called with: flat flags are gathered into their groups."""
    values = {name: value for name, value in vars(parsed).items() if name != "config"}
    for name, kind in _sections(function)[0].items():
        fields = [field.name for field in dataclasses.fields(kind)]
        values[name] = kind(**{field: values.pop(field) for field in fields})
    return values


def _summary_and_example(function: CommandFunction) -> tuple[str, str | None]:
    """Return a docstring's text before its arguments, and its example."""
    text = (inspect.getdoc(function) or "").partition("\nArgs:")[0]
    summary, _, example = text.partition("Example:")
    paragraphs = [" ".join(part.split()) for part in summary.split("\n\n") if part.strip()]
    return "\n\n".join(paragraphs), f"Example: {example.strip()}" if example else None


def _usage(prog: str, function: CommandFunction) -> str:
    hints, parameters = _hints(function), inspect.signature(function).parameters
    words = [
        words if parameters[name].default is inspect.Parameter.empty else f"[{words}]"
        for name in positional(function)
        for words in [place_words(name, hints[name])]
    ]
    return " ".join([prog, *words, "[flags]"])
