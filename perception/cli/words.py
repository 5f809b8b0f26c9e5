"""Words of a command line: the full names of flags, their values, and what cannot be understood."""

import difflib
import json
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from perception.cli.help import item_type, type_words
from perception.errors import UsageError

_PLAIN = (bool, int, float, str, Path)


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
        stem = typed.removesuffix("+")  # appends to a list
        name, is_negated = _full_name(stem.replace("-", "_"), types)
        kind = types.get(name)
        if name != "config" and not _is_known(name, types):
            raise _refused(prog, "command line", _near(word, types), word)
        if kind is bool and not equals:
            is_typed = not is_negated and pending[:1] in (["true"], ["false"])
            value = pending.pop(0) if is_typed else str(not is_negated).lower()
        elif not equals:
            if not pending or pending[0].startswith("--"):
                raise _refused(prog, flag_words(name), type_words(kind), "no value")
            value = pending.pop(0)
        item = item_type(kind)
        value = value if item is None else _as_list(value, item)
        flags.append((f"{name}{typed[len(stem) :]}", value))
    # A list takes all words that are left.
    arguments = []
    for name in places[: len(bare)]:
        is_list = item_type(types[name]) is not None
        arguments.append((name, json.dumps(bare) if is_list else bare[0]))
        bare = [] if is_list else bare[1:]
    if bare:
        raise _refused(prog, "command line", "a flag", bare[0])
    return arguments + flags


def _as_list(value: str, item: Any) -> str:  # noqa: ANN401 - any annotation
    if value.startswith("[") or value == "null":
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


def _is_known(name: str, types: Mapping[str, Any]) -> bool:
    """Return whether a name is a flag, a section, or a parameter of a class that a flag chooses."""
    heads = (name.rpartition(".")[0], name.partition(".")[0])
    return (
        name in types
        or _is_section(name, types)
        or any(head in types and types[head] not in _PLAIN for head in heads)
    )


def _is_section(name: str, types: Mapping[str, Any]) -> bool:
    return any(known.startswith(f"{name}.") for known in types)


def _refused(prog: str, where: str, expected: str, found: str) -> UsageError:
    return UsageError(where, expected=expected, found=found, advice=f"see {prog} --help")


def usage_error(
    prog: str, message: str, types: Mapping[str, Any], places: Sequence[str]
) -> UsageError:
    """Return a parser's message as where, expected and found."""
    if match := re.search(r"arguments are required: (\w+)", message):
        missing = match[1].upper() if match[1] in places else flag_words(match[1])
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
        r'parser key "([^"]+)"(?s:.*)Option \'(.+?)\' is not accepted',
        lambda m, _: (flag_words(m[1]), "a parameter of its class", m[2]),
    ),
    (
        r"group '(.+?)' does not accept option '(.+?)'",
        lambda m, types: ("--config", _near(f"{m[1]}.{m[2]}", types), f"{m[1]}.{m[2]}"),
    ),
    (
        r"(?:key|option) '(.+?)' is not (?:expected|accepted)",
        lambda m, types: ("--config", _near(m[1], types), m[1]),
    ),
    (
        r'parser key "([^"]+)".*?(?:does not exist|unable to load config).*?[\'"](.+?)[\'"]',
        lambda m, _: (flag_words(m[1]), "a YAML file that can be read", m[2]),
    ),
    (
        r'parser key "([^"]+)"(?s:.*(?:Given value|Value|Got value): |.*\n[ -]*)(.+)',
        lambda m, types: (flag_words(m[1]), type_words(types.get(m[1])), m[2]),
    ),
)


def _near(word: str, types: Mapping[str, Any]) -> str:
    """Return what is expected in the place of an unknown flag: the one with the nearest name."""
    name = word.partition("=")[0].lstrip("-").replace("-", "_")
    near = difflib.get_close_matches(name, list(types), n=1)
    return f"a flag such as {flag_words(near[0])}" if near else "a flag"


def flag_words(name: str) -> str:
    """Return a flag as it is typed."""
    return f"--{name}".replace("_", "-")
