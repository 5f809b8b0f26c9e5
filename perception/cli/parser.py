"""From a function's signature to the flags of a command, and from words to a call.

A command is a function. Its positional parameters are positional arguments, its keyword-only parameters are flags, and its docstring
is the help. A parameter whose type is a `FlagGroup` becomes flat flags under a heading of their own; a parameter whose type is any
other dataclass becomes nested flags, such as `--pipeline.motion.voxel-size 0.2`, and a section of a YAML file for `--config`.
A parameter whose type is `CommandConfig` is no flag: it gets the effective values of all others, in the form that `--config` reads.
"""

import argparse
import dataclasses
import difflib
import inspect
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from types import NoneType
from typing import Any, TypeVar, get_args, get_type_hints

from jsonargparse import ArgumentParser, Namespace

from data.results.command_config import CommandConfig, read_config
from perception.cli.help import help_formatter, item_type, place_words, type_words
from perception.errors import UsageError

CommandFunction = Callable[..., None]
Function = TypeVar("Function", bound=CommandFunction)

# Flags that name outputs, or what happens to earlier ones; they belong to no configuration.
_OUTPUTS = {
    "json", "out", "overwrite", "plot", "plots", "reliability_plot", "resume", "worst_frames",
}  # fmt: skip
_PRINT_CONFIG = {"--print-config", "--print_config"}
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
    """Parse the words of a command line and call the function, or print its configuration.

    Raises:
        UsageError: A flag is unknown, or its value is not of its type.
    """
    asked = [word for word in words if word not in _PRINT_CONFIG]
    arguments, config = parse(prog, function, asked)
    if len(asked) < len(words):
        print(config.text(), end="")
        return
    hints = get_type_hints(function)
    function(**arguments, **{name: config for name, kind in hints.items() if kind is CommandConfig})


def parse(
    prog: str, function: CommandFunction, words: Sequence[str]
) -> tuple[dict[str, Any], CommandConfig]:
    """Return the arguments that the words of a command line give a function, and the same as a configuration.

    Raises:
        UsageError: A flag is unknown, or its value is not of its type.
    """
    types, places = flag_types(function), _positional(function)
    given = read_words(prog, words, types, places)
    configs = [read_config(Path(value)) for name, value in given if name == "config"]
    flags = [(name, value) for name, value in given if name != "config"]
    parser = build_parser(prog, function)
    try:
        parser.set_defaults(_preset_defaults(function, [*map(dict.items, configs), flags]))
        files = [f"--config={json.dumps(config)}" for config in configs]
        parsed = parser.parse_args([*files, *(f"--{name}={value}" for name, value in flags)])
    except argparse.ArgumentError as error:
        raise _usage_error(prog, str(error), types, places) from error
    arguments = _arguments(function, parser.instantiate(parsed))
    values = dict(_config_values(function, arguments))
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
        formatter_class=help_formatter(
            flag_types(function), _positional(function), summary.partition("\n")[0]
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
    parser.epilog = example
    return parser


def flag_types(function: CommandFunction) -> dict[str, Any]:
    """Return the type of each flag by its full name, nested ones with dots."""
    hints = _hints(function)
    return dict(_walk(hints, iter(hints)))


def read_words(
    prog: str, words: Sequence[str], types: Mapping[str, Any], places: Sequence[str]
) -> list[tuple[str, str]]:
    """Return the full name and the value of each argument and flag, as jsonargparse reads them.

    `--on-bad-frame` is `on_bad_frame`; `--no-video` and `--video` are false and true; `a,b` is a list; the end of a long name may be
    left out: `--pipeline.motion.voxel-size` stands for `pipeline.motion.voxel_size_m`.

    Args:
        prog: Words that call the command.
        words: Words of the command line behind them.
        types: Type of each flag by its full name.
        places: Names of the positional arguments.

    Raises:
        UsageError: A flag is unknown or lacks its value, or there are too many positional arguments.
    """
    pending, bare, flags = list(words), [], []
    while pending:
        word = pending.pop(0)
        if not word.startswith("--"):
            bare.append(word)
            continue
        typed, equals, value = word[2:].partition("=")
        name, is_negated = _full_name(typed.replace("-", "_"), types)
        kind = types.get(name)
        if name not in types and name != "config" and not _is_section(name, types):
            raise _refused(prog, "command line", _near(word, types), word)
        if kind is bool and not equals:
            is_typed = not is_negated and pending[:1] in (["true"], ["false"])
            value = pending.pop(0) if is_typed else str(not is_negated).lower()
        elif not equals:
            if not pending or pending[0].startswith("--"):
                raise _refused(prog, _flag(name), type_words(kind), "no value")
            value = pending.pop(0)
        item = item_type(kind)
        flags.append((name, value if item is None else _as_list(value, item)))
    # A list takes all words that are left.
    arguments = []
    for name in places[: len(bare)]:
        is_list = item_type(types[name]) is not None
        arguments.append((name, json.dumps(bare) if is_list else bare[0]))
        bare = [] if is_list else bare[1:]
    if bare:
        raise _refused(prog, "command line", "a flag", bare[0])
    return arguments + flags


def _preset_defaults(
    function: CommandFunction, given: Iterable[Iterable[tuple[str, Any]]]
) -> dict[str, object]:
    """Return the defaults of the preset that files and words choose, by full name."""
    flag, presets = _PRESETS.get(function, ("", {}))
    chosen = dict(chain.from_iterable(given)).get(flag)
    defaults: dict[str, object] = {}
    for name, section in presets.get(str(chosen), {}).items():
        defaults |= dict(_leaves(name, section))
    return defaults


def _config_values(
    function: CommandFunction, arguments: Mapping[str, Any]
) -> Iterator[tuple[str, Any]]:
    """Yield the value of each argument and flag that does not name an output."""
    flat = _sections(function)[0]
    for name, value in arguments.items():
        for flag, one in vars(value).items() if name in flat else [(name, value)]:
            if flag not in _OUTPUTS:
                yield flag, one


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
    kinds = {name: _without_none(hint) for name, hint in _hints(function).items()}
    sections: dict[str, type] = {
        name: kind
        for name, kind in kinds.items()
        if isinstance(kind, type) and dataclasses.is_dataclass(kind)
    }
    flat = {name: kind for name, kind in sections.items() if _is_flat(kind)}
    return flat, {name: kind for name, kind in sections.items() if name not in flat}


def _hints(function: CommandFunction) -> dict[str, Any]:
    """Return the type of each parameter that becomes an argument or flags."""
    hints = get_type_hints(function)
    names = inspect.signature(function).parameters
    return {name: hints[name] for name in names if hints[name] is not CommandConfig}


def _positional(function: CommandFunction) -> list[str]:
    parameters = inspect.signature(function).parameters.values()
    return [one.name for one in parameters if one.kind is not one.KEYWORD_ONLY]


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


def _full_name(name: str, types: Mapping[str, Any]) -> tuple[str, bool]:
    """Return the whole name of a flag, and whether it is negated: --no-video, --pipeline.no-overlap."""
    head, dot, last = name.rpartition(".")
    positive = f"{head}{dot}{last.removeprefix('no_')}".removeprefix("no_")
    if positive != name and types.get(positive) is bool:
        return positive, True
    if name in types or _is_section(name, types):
        return name, False
    begun = [known for known in types if known.startswith(name)]
    return (begun[0] if len(begun) == 1 else name), False


def _is_section(name: str, types: Mapping[str, Any]) -> bool:
    return any(known.startswith(f"{name}.") for known in types)


def _arguments(function: CommandFunction, parsed: Namespace) -> dict[str, Any]:
    """Return what the function is called with: flat flags are gathered into their groups."""
    values = {name: value for name, value in vars(parsed).items() if name != "config"}
    for name, kind in _sections(function)[0].items():
        fields = [field.name for field in dataclasses.fields(kind)]
        values[name] = kind(**{field: values.pop(field) for field in fields})
    return values


def _refused(prog: str, where: str, expected: str, found: str) -> UsageError:
    return UsageError(where, expected=expected, found=found, advice=f"see {prog} --help")


def _usage_error(
    prog: str, message: str, types: Mapping[str, Any], places: Sequence[str]
) -> UsageError:
    """Return a parser's message as where, expected and found."""
    if match := re.search(r"arguments are required: (\w+)", message):
        missing = match[1].upper() if match[1] in places else _flag(match[1])
        return _refused(prog, "command line", missing, "nothing")
    for pattern, explain in _EXPLANATIONS:
        if match := re.search(pattern, message, re.IGNORECASE):
            return _refused(prog, *explain(match, types))
    return _refused(prog, "command line", "flags and values", " ".join(message.split()))


# Messages of argparse and jsonargparse, the first that fits counts: where, expected, found.
_EXPLANATIONS: Sequence[
    tuple[str, Callable[[re.Match[str], Mapping[str, Any]], tuple[str, str, str]]]
] = (
    (
        r"group '(.+?)' does not accept option '(.+?)'",
        lambda m, types: ("--config", _near(f"{m[1]}.{m[2]}", types), f"{m[1]}.{m[2]}"),
    ),
    (r"key '(.+?)' is not expected", lambda m, types: ("--config", _near(m[1], types), m[1])),
    (
        r'parser key "([^"]+)".*?(?:does not exist|unable to load config).*?[\'"](.+?)[\'"]',
        lambda m, _: (_flag(m[1]), "a YAML file that can be read", m[2]),
    ),
    (
        r'parser key "([^"]+)"(?s:.*(?:Given value|Value|Got value): |.*\n[ -]*)(.+)',
        lambda m, types: (_flag(m[1]), type_words(types.get(m[1])), m[2]),
    ),
)


def _near(word: str, types: Mapping[str, Any]) -> str:
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


def _usage(prog: str, function: CommandFunction) -> str:
    hints = _hints(function)
    words = (place_words(name, hints[name]) for name in _positional(function))
    return " ".join([prog, *words, "[flags]"])
