"""The console script: find the command, make its flags from its signature, turn an error into a sentence.

A command is a function in a module of this folder; its docstring is its help, its arguments its flags.
Modules are imported only when their command is asked for, so that `trifuse --help` answers at once.
"""

import importlib
import inspect
import json
import logging
import sys
from collections.abc import Callable, Sequence
from typing import Any, get_origin

from jsonargparse import auto_cli

from perception import __version__
from perception.errors import PerceptionError

# command: what it does. The module of the same name holds a function of the same name, or COMMANDS.
COMMANDS = {
    "demo": "make a short synthetic drive and run every stage on it; needs no data",
    "run": "run the stages on a drive; write results, a video and a summary",
    "track": "follow one object: its trajectory, speed and box, and a video",
    "maps": "make dense depth and reflectance maps from scans, as the camera sees them",
    "detect": "detect vehicles by LiDAR; write KITTI's result files and pictures",
    "synth": "write synthetic drives in KITTI's layouts, with exact point truth",
    "check": "read everything once; report what is missing, damaged or implausible",
    "evaluate": "measure ground, obstacles, objects, tracks and vehicles against labels or exact truth",
    "train": "fit to labelled drives: rules of the proposals, networks",
    "study": "repeat one of the thesis' own studies: a picture and a table",
    "export": "write a trained network as an ONNX file, shown to say the same",
    "bench": "time every stage beside its plain form and the best library for it",
}

_HELP = """usage: trifuse COMMAND [options]

{commands}

Begin with:  trifuse demo
Then:        trifuse run path/to/2011_09_26/2011_09_26_drive_0005_sync --out results/0005
Help:        trifuse COMMAND --help
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return 0, or 2 where the user has to act."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if not words or words[0] in ("-h", "--help", "help"):
        print(_help())
        return 0
    if words[0] == "--version":
        print(f"trifuse {__version__}")
        return 0
    if words[0] not in COMMANDS:
        print(f"trifuse: no command {words[0]!r}; one of {', '.join(COMMANDS)}", file=sys.stderr)
        return 2
    logging.basicConfig(stream=sys.stderr, format="%(message)s", level=logging.INFO)
    try:
        _run(words[0], words[1:])
    except PerceptionError as error:
        print(f"trifuse {words[0]}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"trifuse {words[0]}: stopped; what was written is kept", file=sys.stderr)
        return 2
    return 0


def _help() -> str:
    width = max(map(len, COMMANDS))
    return _HELP.format(
        commands="\n".join(f"  {n:<{width}}  {what}" for n, what in COMMANDS.items())
    )


def _run(command: str, words: list[str]) -> None:
    module = importlib.import_module(f"perception.cli.{command}")
    functions: dict[str, Callable[..., Any]] = getattr(module, "COMMANDS", {})
    target: Any = functions or getattr(module, command)
    auto_cli(
        target,
        args=_with_list([_with_underscores(word) for word in words], functions),
        as_positional=True,
        set_defaults=None,
        prog=f"trifuse {command}",
    )


def _with_underscores(word: str) -> str:
    """Let --on-bad-frame be the same flag as --on_bad_frame."""
    if not word.startswith("--"):
        return word
    flag, equals, value = word.partition("=")
    return "--" + flag[2:].replace("-", "_") + equals + value


def _with_list(words: list[str], functions: dict[str, Callable[..., Any]]) -> list[str]:
    """Let the words behind a subcommand fill the list that it begins with: train proposals ONE TWO."""
    function = functions.get(words[0]) if words else None
    if function is None:
        return words
    first = next(iter(inspect.signature(function).parameters.values()), None)
    if first is None or get_origin(first.annotation) is not list:
        return words
    flags = next((at for at, word in enumerate(words) if word.startswith("-")), len(words))
    plain = words[1:flags]
    gathered = [json.dumps(plain)] if plain and not plain[0].startswith("[") else plain
    return [words[0], *gathered, *words[flags:]]
