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
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import NoneType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from jsonargparse import ArgumentParser, Namespace

from perception.cli.help import help_formatter, item_type, type_words
from perception.errors import UsageError

CommandFunction = Callable[..., None]
Function = TypeVar("Function", bound=CommandFunction)

_PRESETS: dict[CommandFunction, tuple[str, Mapping[str, Mapping[str, object]]]] = {}


class FlagGroup:
    """Base of the dataclasses whose fields become flat flags of every command that takes one."""


def defaults_by(
    flag: str, presets: Mapping[str, Mapping[str, object]]
) -> Callable[[Function], Function]:
    """Return a decorator that gives a command other defaults for each value of a flag.

    Args:
        flag: Name of the flag, such as `preset`.
        presets: Defaults by value of the flag, then by name of a flag or a section; what is typed wins.
    """

    def decorate(function: Function) -> Function:
        _PRESETS[function] = flag, presets
        return function

    return decorate


def call(prog: str, function: CommandFunction, words: Sequence[str]) -> None:
    """Parse the words of a command line and call the function.

    Raises:
        UsageError: a flag is unknown, or its value is not of its type.
    """
    types = flag_types(function)
    parser = build_parser(prog, function)
    try:
        normal = normalize(words, types)
        parser.set_defaults(_preset_defaults(function, normal))
        parsed = parser.parse_args(normal)
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
    _, nested = _sections(function)
    parser = build_parser(prog, function, skip=() if everything else tuple(nested))
    if nested and not everything:
        names = ", ".join(f"{_flag(name)}.*" for name in nested)
        note = f"{names}: parameters of the method, listed by --help-all."
        parser.epilog = "\n".join(filter(None, [note, parser.epilog]))
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
        formatter_class=help_formatter(flag_types(function), summary.partition("\n")[0]),
        exit_on_error=False,
        allow_abbrev=True,
        add_help=False,
    )
    parser.add_argument("--config", action="config", help="YAML file with values of flags.")
    groups, _ = _sections(function)
    places = {one.name: one for one in _positional(function)}
    lists = {name for name, one in places.items() if get_origin(one.annotation) is list}
    documented = _parameter_help(function)
    for name in lists:
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
        item = item_type(kind)
        if item is not None and not equals and pending and not pending[0].startswith("--"):
            equals, value = "=", pending.pop(0)
        normal.append(f"--{name}{equals}{_as_list(value, item) if item and equals else value}")
    return normal


def _preset_defaults(function: CommandFunction, words: Sequence[str]) -> dict[str, object]:
    """Return the defaults of the preset that the words choose, by full name."""
    flag, presets = _PRESETS.get(function, ("", {}))
    chosen = [words[at + 1] for at, word in enumerate(words[:-1]) if word == f"--{flag}"]
    chosen += [word.partition("=")[2] for word in words if word.startswith(f"--{flag}=")]
    defaults: dict[str, object] = {}
    for value in chosen:
        for name, section in presets.get(value, {}).items():
            defaults |= dict(_leaves(name, section))
    return defaults


def _leaves(name: str, value: object) -> Iterator[tuple[str, object]]:
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from _leaves(f"{name}.{field.name}", getattr(value, field.name))
    else:
        yield name, value


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


def _sections(function: CommandFunction) -> tuple[dict[str, type], dict[str, type]]:
    """Return the parameters that become flat flags, and those that become nested ones."""
    kinds = {name: _without_none(hint) for name, hint in get_type_hints(function).items()}
    sections: dict[str, type] = {
        name: kind
        for name, kind in kinds.items()
        if isinstance(kind, type) and dataclasses.is_dataclass(kind)
    }
    flat = {name: kind for name, kind in sections.items() if _is_flat(kind)}
    return flat, {name: kind for name, kind in sections.items() if name not in flat}


def _positional(function: CommandFunction) -> list[inspect.Parameter]:
    parameters = inspect.signature(function).parameters.values()
    return [one for one in parameters if one.kind is not one.KEYWORD_ONLY]


def _is_flat(kind: type) -> bool:
    return issubclass(kind, FlagGroup)


def _without_none(kind: Any) -> Any:  # noqa: ANN401 - any annotation
    members = [member for member in get_args(kind) if member is not NoneType]
    is_optional = len(members) < len(get_args(kind)) and len(members) == 1
    return members[0] if is_optional else kind


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
    for name, kind in _sections(function)[0].items():
        fields = [field.name for field in dataclasses.fields(kind)]
        values[name] = kind(**{field: values.pop(field) for field in fields})
    return values


def _usage_error(prog: str, message: str, types: dict[str, Any]) -> UsageError:
    """Return a parser's message as where, expected and found."""
    advice = f"see {prog} --help"
    for pattern, explain in _EXPLANATIONS:
        if match := re.search(pattern, message, re.IGNORECASE):
            where, expected, found = explain(match, types)
            return UsageError(where, expected=expected, found=found, advice=advice)
    found = " ".join(message.split())
    return UsageError("command line", expected="flags and values", found=found, advice=advice)


# Messages of argparse and jsonargparse, the first that fits counts: where, expected, found.
_EXPLANATIONS: Sequence[
    tuple[str, Callable[[re.Match[str], dict[str, Any]], tuple[str, str, str]]]
] = (
    (r"unrecognized arguments: (\S+)", lambda m, types: ("command line", _near(m[1], types), m[1])),
    (
        r"group '(.+?)' does not accept option '(.+?)'",
        lambda m, types: ("--config", _near(f"{m[1]}.{m[2]}", types), f"{m[1]}.{m[2]}"),
    ),
    (r"key '(.+?)' is not expected", lambda m, types: ("--config", _near(m[1], types), m[1])),
    (
        r'(?:arguments are required: |key "(?=.+ is required))([^"]+)',
        lambda m, _: ("command line", m[1].upper(), "nothing"),
    ),
    (
        r"argument --(\S+): expected one argument",
        lambda m, types: (_flag(m[1]), type_words(types.get(m[1])), "no value"),
    ),
    (
        r'parser key "([^"]+)".*?(?:does not exist|unable to load config).*?[\'"](.+?)[\'"]',
        lambda m, _: (_flag(m[1]), "a YAML file that can be read", m[2]),
    ),
    (
        r'parser key "([^"]+)"(?s:.*(?:Given value|Value|Got value): |.*\n[ -]*)(.+)',
        lambda m, types: (_flag(m[1]), type_words(types.get(m[1])), m[2]),
    ),
)


def _near(word: str, types: dict[str, Any]) -> str:
    """Return what is expected in the place of an unknown flag: the one with the nearest name."""
    name = word.partition("=")[0].lstrip("-").replace("-", "_")
    near = difflib.get_close_matches(name, list(types), n=1)
    return f"a flag such as {_flag(near[0])}" if near else "a flag"


def _flag(name: str) -> str:
    return f"--{name}".replace("_", "-")


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
    names = (
        f"{one.name.upper()}{' ...' if get_origin(one.annotation) is list else ''}"
        if one.default is one.empty
        else f"[{one.name.upper()}]"
        for one in _positional(function)
    )
    return " ".join([prog, *names, "[flags]"])
