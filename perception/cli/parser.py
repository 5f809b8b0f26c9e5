"""From a function's signature to the flags of a command, and from words to a call.

A command is a function. Its positional parameters are positional arguments, its keyword-only parameters are flags, and its docstring
is the help. A parameter whose type is a `FlagGroup` becomes flat flags under a heading of their own; a parameter whose type is any
other dataclass becomes nested flags, such as `--pipeline.motion.voxel-size 0.2`, and a section of a YAML file for `--config`.
"""

import argparse
import dataclasses
import difflib
import inspect
import json
import re
from collections.abc import Callable, Iterator, Sequence
from types import NoneType
from typing import Any, Literal, get_args, get_origin, get_type_hints

from jsonargparse import ArgumentParser, Namespace

from perception.errors import UsageError

CommandFunction = Callable[..., None]


class FlagGroup:
    """Base of the dataclasses whose fields become flat flags of every command that takes one."""


def call(prog: str, function: CommandFunction, words: Sequence[str]) -> None:
    """Parse the words of a command line and call the function.

    Raises:
        UsageError: a flag is unknown, or its value is not of its type.
    """
    types = flag_types(function)
    parser = build_parser(prog, function)
    try:
        parsed = parser.parse_args(normalize(words, types))
    except argparse.ArgumentError as error:
        raise _usage_error(prog, str(error), types) from error
    function(**_arguments(function, parser.instantiate(parsed)))


def help_text(prog: str, function: CommandFunction, *, everything: bool) -> str:
    """Return the help of a command.

    Args:
        prog: Words that call the command.
        function: The command.
        everything: Whether the nested flags are listed too.
    """
    nested = {name: kind for name, kind in _dataclass_parameters(function) if not _is_flat(kind)}
    parser = build_parser(prog, function, skip=() if everything else tuple(nested))
    if nested and not everything:
        names = ", ".join(f"--{name}.*" for name in nested)
        parser.epilog = f"{names}: every parameter of the method, listed by --help-all."
    return parser.format_help().rstrip()


def build_parser(
    prog: str, function: CommandFunction, *, skip: Sequence[str] = ()
) -> ArgumentParser:
    """Return the parser of a command.

    Args:
        prog: Words that call the command.
        function: The command.
        skip: Parameters that get no flags.
    """
    summary, example = _summary_and_example(function)
    parser = ArgumentParser(
        prog=prog,
        usage=_usage(prog, function),
        description=summary,
        formatter_class=_Help,
        exit_on_error=False,
        allow_abbrev=True,
        add_help=False,
    )
    parser.add_argument("--config", action="config", help="YAML file with flags.")
    groups = {name: kind for name, kind in _dataclass_parameters(function) if _is_flat(kind)}
    lists = {
        name
        for name, parameter in inspect.signature(function).parameters.items()
        if parameter.kind is not parameter.KEYWORD_ONLY and get_origin(parameter.annotation) is list
    }
    documented = _parameter_help(function)
    for name in lists - set(skip):
        (kind,) = get_args(get_type_hints(function)[name])
        parser.add_argument(name, nargs="+", type=kind, help=documented.get(name))
    parser.add_function_arguments(
        function, as_positional=True, skip={*groups, *lists, *skip}, fail_untyped=True
    )
    for kind in groups.values():
        parser.add_class_arguments(kind, nested_key=None)
    parser.epilog = example
    return parser


def flag_types(function: CommandFunction) -> dict[str, Any]:
    """Return the type of each flag by its full name, nested ones with dots."""
    hints = get_type_hints(function)
    return dict(_walk(hints, (name for name in inspect.signature(function).parameters)))


def normalize(words: Sequence[str], types: dict[str, Any]) -> list[str]:
    """Return the words as jsonargparse reads them.

    `--on-bad-frame` is `--on_bad_frame`; `--no-video` and `--video` are false and true; `a,b` is a list; the end of a long name may
    be left out: `--pipeline.motion.voxel-size` stands for `--pipeline.motion.voxel_size_m`.
    """
    pending, normal = list(words), []
    while pending:
        word = pending.pop(0)
        if not word.startswith("--"):
            normal.append(word)
            continue
        flag, equals, value = word[2:].partition("=")
        name, is_negated = _full_name(flag.replace("-", "_"), types)
        kind = types.get(name)
        if kind is bool and not equals:
            if pending and pending[0] in ("true", "false") and not is_negated:
                value = pending.pop(0)
            else:
                value = "false" if is_negated else "true"
            normal.append(f"--{name}={value}")
            continue
        item = _item_type(kind)
        if item is not None and not equals and pending and not pending[0].startswith("--"):
            equals, value = "=", pending.pop(0)
        normal.append(f"--{name}{equals}{_as_list(value, item) if item and equals else value}")
    return normal


def _walk(
    hints: dict[str, Any], names: Iterator[str], prefix: str = ""
) -> Iterator[tuple[str, Any]]:
    for name in names:
        kind = _without_none(hints[name])
        if isinstance(kind, type) and dataclasses.is_dataclass(kind):
            inner = prefix if _is_flat(kind) else f"{prefix}{name}."
            fields = (field.name for field in dataclasses.fields(kind))
            yield from _walk(get_type_hints(kind), fields, inner)
        else:
            yield f"{prefix}{name}", kind


def _dataclass_parameters(function: CommandFunction) -> Iterator[tuple[str, type]]:
    hints = get_type_hints(function)
    for name in inspect.signature(function).parameters:
        kind = _without_none(hints[name])
        if isinstance(kind, type) and dataclasses.is_dataclass(kind):
            yield name, kind


def _is_flat(kind: type) -> bool:
    return issubclass(kind, FlagGroup)


def _without_none(kind: Any) -> Any:  # noqa: ANN401 - any annotation
    members = [member for member in get_args(kind) if member is not NoneType]
    is_optional = len(members) < len(get_args(kind)) and len(members) == 1
    return members[0] if is_optional else kind


def _item_type(kind: Any) -> Any | None:  # noqa: ANN401 - any annotation
    """Return the type of a list's items, or None of what is no list."""
    return get_args(kind)[0] if get_origin(kind) in (list, tuple) else None


def _as_list(value: str, item: Any) -> str:  # noqa: ANN401 - any annotation
    if value.startswith("["):
        return value
    items = [part.strip() for part in value.split(",") if part.strip()]
    return f"[{','.join(items)}]" if item in (int, float) else json.dumps(items)


def _full_name(name: str, types: dict[str, Any]) -> tuple[str, bool]:
    """Return the whole name of a flag, and whether it is negated: --no-video, --pipeline.no-overlap."""
    head, dot, last = name.rpartition(".")
    positive = f"{head}{dot}{last.removeprefix('no_')}".removeprefix("no_")
    if positive != name and types.get(positive) is bool:
        return positive, True
    if name in types:
        return name, False
    begun = [known for known in types if known.startswith(f"{name}_")]
    return (begun[0] if len(begun) == 1 else name), False


def _arguments(function: CommandFunction, parsed: Namespace) -> dict[str, Any]:
    """Return what the function is called with: flat flags are gathered into their groups."""
    values = {name: value for name, value in vars(parsed).items() if name != "config"}
    for name, kind in _dataclass_parameters(function):
        if _is_flat(kind):
            fields = [field.name for field in dataclasses.fields(kind)]
            values[name] = kind(**{field: values.pop(field) for field in fields})
    return values


def _usage_error(prog: str, message: str, types: dict[str, Any]) -> UsageError:
    """Return a parser's message as one sentence."""
    advice = f"see {prog} --help"
    if unknown := re.search(r"unrecognized arguments: (\S+)", message, re.IGNORECASE):
        word = unknown.group(1)
        flags = [f"--{name}".replace("_", "-") for name in types]
        near = difflib.get_close_matches(word.partition("=")[0].replace("_", "-"), flags, n=1)
        expected = f"a flag of {prog}" + (f" such as {near[0]}" if near else "")
        return UsageError("command line", expected=expected, found=word, advice=advice)
    if missing := re.search(r"arguments are required: (.+)", message):
        return UsageError("command line", expected=missing.group(1), found="nothing", advice=advice)
    if missing := re.search(r'[Kk]ey "([^"]+)" is required', message):
        return UsageError(f"--{missing.group(1)}", expected="a value", found="none", advice=advice)
    if bad := re.search(r'[Pp]arser key "([^"]+)"', message):
        name = bad.group(1)
        given = re.search(r"(?:Given value|Value|Got value): (.+)", message)
        lines = [line.strip(" -") for line in message.splitlines()]
        return UsageError(
            f"--{name}".replace("_", "-"),
            expected=_type_words(types.get(name)),
            found=given.group(1) if given else lines[-1],
            advice=advice,
        )
    return UsageError(
        "command line", expected="flags and values", found=" ".join(message.split()), advice=advice
    )


def _type_words(kind: Any) -> str:  # noqa: ANN401 - any annotation
    """Return a type in words for a person."""
    if get_origin(kind) is Literal:
        return "one of " + ", ".join(map(str, get_args(kind)))
    if (item := _item_type(kind)) is not None:
        return f"{_type_words(item)}, several with commas between them"
    words = {int: "a whole number", float: "a number", bool: "true or false", str: "a word"}
    return words.get(kind, getattr(kind, "__name__", str(kind)).lower())


def _summary_and_example(function: CommandFunction) -> tuple[str, str | None]:
    """Return a docstring's text before its arguments, and its example."""
    text = (inspect.getdoc(function) or "").partition("\nArgs:")[0]
    summary, _, example = text.partition("Example:")
    paragraphs = [" ".join(part.split()) for part in summary.split("\n\n") if part.strip()]
    return "\n\n".join(paragraphs), f"Example: {example.strip()}" if example else None


def _parameter_help(function: CommandFunction) -> dict[str, str]:
    """Return the entries below `Args:` by name."""
    text = (inspect.getdoc(function) or "").partition("\nArgs:\n")[2]
    entries = re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", text, re.MULTILINE)
    return {name: " ".join(words.split()) for name, words in entries}


def _usage(prog: str, function: CommandFunction) -> str:
    signature = inspect.signature(function).parameters.values()
    places = [one for one in signature if one.kind is not one.KEYWORD_ONLY]
    names = (
        f"{one.name.upper()}{' ...' if get_origin(one.annotation) is list else ''}"
        if one.default is one.empty
        else f"[{one.name.upper()}]"
        for one in places
    )
    return " ".join([prog, *names, "[flags]"])


class _Help(argparse.RawDescriptionHelpFormatter):
    """Shows flags as they are typed, with their defaults."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=34, width=110)

    def _format_action_invocation(self, action: argparse.Action) -> str:
        if not action.option_strings:
            return action.dest.upper()
        flag = max(action.option_strings, key=len).removesuffix("+").replace("_", "-")
        if isinstance(action.default, bool):
            return flag if not action.default else f"--no-{flag[2:]}"
        if action.choices is not None:
            return f"{flag} {{{','.join(map(str, action.choices))}}}"
        return flag if action.nargs == 0 else f"{flag} {action.dest.rpartition('.')[2].upper()}"

    def _get_help_string(self, action: argparse.Action) -> str:
        help_words = re.sub(r"%(?!\()", "%%", action.help or "")
        is_shown = action.option_strings and action.default not in (None, argparse.SUPPRESS, "")
        if is_shown and not isinstance(action.default, bool):
            return f"{help_words} [{_shown(action.default)}]"
        return help_words


def _shown(value: object) -> str:
    if isinstance(value, list | tuple):
        return ",".join(map(str, value))
    return f"{value:g}" if isinstance(value, float) else str(value)
