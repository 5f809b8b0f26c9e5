"""The console script: find the command, parse its flags, turn an error into a sentence."""

import atexit
import importlib
import logging
import os
import signal
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_type_hints

from perception import __version__
from perception.cli.parser import (
    CommandFunction,
    call,
    flag_types,
    help_text,
    nested_types,
    positional,
)
from perception.errors import PerceptionError, UsageError
from train.trainings import TRAININGS, EverydayFlags, training_of


@dataclass(frozen=True)
class Command:
    """A command by its words.

    Attributes:
        target: Module and function, `module:function`.
        summary: One line of help.
    """

    target: str
    summary: str

    def load(self) -> CommandFunction:
        """Import the function.

        Raises:
            PerceptionError: It is in benchmarks/, which only the source tree holds.
        """
        module, _, name = self.target.partition(":")
        try:
            function: CommandFunction = getattr(importlib.import_module(module), name)
        except ModuleNotFoundError as error:
            if error.name is None or error.name.partition(".")[0] != "benchmarks":
                raise
            raise PerceptionError(
                module,
                expected="the folder benchmarks/ of the source tree, which a wheel does not hold",
                found="none",
                advice='in the source tree of this version, run: pip install --editable ".[bench]"',
            ) from error
        return function

    def run(self, name: str, words: Sequence[str]) -> None:
        """Call the function as the words say.

        Args:
            name: Words that call the command, such as `evaluate ground`.
            words: Words behind them.

        Raises:
            PerceptionError: The user has to act.
        """
        call(f"trifuse {name}", self.load(), words)

    def help(self, name: str, *, everything: bool) -> str:
        """Return the help, of every flag where all are asked for."""
        return help_text(f"trifuse {name}", self.load(), everything=everything)

    def flags(self) -> Mapping[str, Any]:
        """Return the type of each flag by its name."""
        return flag_types(self.load())

    def places(self) -> Sequence[str]:
        """Return the names of the positional arguments."""
        return positional(self.load())


@dataclass(frozen=True)
class TrainingCommand(Command):
    """A training, whose words Lightning's command line reads; the target is its name."""

    def run(self, name: str, words: Sequence[str]) -> None:
        """Train or evaluate a network."""
        from perception.cli.train import train

        train(training_of(self.target, words), words)

    def help(self, name: str, *, everything: bool) -> str:
        """Return the help; that of every flag imports torch."""
        from perception.cli.train import help_text

        return help_text(self.target, everything=everything)

    def flags(self) -> Mapping[str, Any]:
        """Return the type of each short flag by its name."""
        return dict(nested_types(get_type_hints(EverydayFlags)))

    def places(self) -> Sequence[str]:
        """Return the names of the positional arguments."""
        return ["drives"]


class BatchCommand(Command):
    """A command on many drives; the target has the flags of the batch, and the words hold those of the command, too."""

    def run(self, name: str, words: Sequence[str]) -> None:
        """Run the command on every drive; that of a group, such as evaluate, is the first word."""
        from perception.cli.batch import run_batch

        command, rest = self.of_drive(name, words)
        run_batch(self.load(), command, COMMANDS[command].load(), rest, run_command_line)

    def of_drive(self, name: str, words: Sequence[str]) -> tuple[str, Sequence[str]]:
        """Return the command of each drive, and the words behind it."""
        command = name.removeprefix("batch ")
        if command not in GROUPS:
            return command, words
        known = [one.split()[1] for one in COMMANDS if one.startswith(f"{command} ")]
        if not words or words[0] not in known:
            found = words[0] if words else "none"
            raise UsageError("command line", expected=f"one of {', '.join(known)}", found=found)
        return f"{command} {words[0]}", words[1:]


# Commands by their words. "evaluate results" is the function `evaluate_results` of perception/cli/evaluate_results.py;
# modules are imported when their command is called, so that `trifuse --help` is quick.
SUMMARIES: Mapping[str, str] = {
    "demo": "make a short synthetic drive and run every stage on it; needs no data",
    "run": "run the pipeline on a drive; write results, a video and a summary",
    "label": "propose labels for a drive, with a page to review them",
    "adapt": "train the detector from above further on your drives; keep it where it is better",
    "serve": "run the pipeline live, on a LiDAR or a drive; show results in Foxglove and similar viewers",
    "track": "track one object: trajectory, speed, box and a video",
    "detect": "detect vehicles by DepthCN; write KITTI result files",
    "maps": "write dense depth and reflectance maps as the camera sees them",
    "synth": "write synthetic drives in KITTI's layouts, with exact point truth",
    "split": "split labelled frames into training, validation and test",
    "shards": "write labelled frames as tar files from which trainings stream, here or in an object store",
    "report": "write the HTML report of results, or compare two runs",
    "adopt": "inspect a folder of scans of any format and write its drive.yaml",
    "calibrate": "find the calibration of LiDAR and camera by the edges of both",
    "check": "read a drive; report what is missing, damaged or implausible",
    "evaluate": "measure a stage against labels or exact truth",
    "evaluate ground": "error of the estimated ground at labelled objects",
    "evaluate obstacles": "objects missed, false moving clusters",
    "evaluate poses": "poses beside those of the drive, with and without INS",
    "evaluate datmo": "tracks of moving objects, several methods compared",
    "evaluate otd": "trackers of one object, on the sequences of the thesis",
    "evaluate vehicles": "detected vehicles as objects on the road",
    "evaluate detection": "average precision of the vehicle detectors and their fusion",
    "evaluate robustness": "average precision under sensor corruptions",
    "evaluate results": "metrics of result files of any program",
    "batch": "run a command on many drives at once, on all cores or a cluster",
    "batch run": "the pipeline",
    "batch label": "proposals of labels",
    "batch detect": "DepthCN",
    "batch maps": "dense depth and reflectance maps",
    "batch check": "what is missing, damaged or implausible",
    "batch evaluate": "a stage against labels or exact truth",
    "batch synth": "synthetic drives",
    "train": "train networks, or search the parameters of the proposals",
    "train detector": "image detector of one modality",
    "train bev": "detector of the bird's-eye view",
    "train fusion": "fusion of the three modalities' detectors",
    "train depthcn": "network that verifies DepthCN's proposals",
    "train proposals": "search of the proposals' parameters",
    "export": "write a trained network as an ONNX file with a parity report",
    "study": "repeat a study of the thesis: a figure and a table; in the source tree",
    "study ground-error": "ground error over merged scans and slice width (Fig. 7.1)",
    "study speed": "frames per second over merged scans and voxel size (Fig. 7.3)",
    "study stages": "share of the time of each stage (Table 7.3)",
    "study dense-cloud": "a pole in the merged cloud, before and after registration (Fig. 5.2)",
    "study gates": "gates and planes of the ground, from the side (Figs 5.4, 5.5)",
    "study masks": "counters and masks of the static-moving segmentation (Fig. 5.6)",
    "study motion-grid": "2.5D motion grids and the objects in them (Fig. 5.10)",
    "study datmo-film": "film of the 2.5D motion grids on a highway, at a junction and at a crossing (Fig. 7.6)",
    "study ins-error": "tracks of moving objects over the error of the INS (7.1.1)",
    "study sensors": "tracks of moving objects by LiDAR",
    "study poses": "poses over LiDAR, frame rate and INS, beside KISS-ICP and small_gicp",
    "study uncertainty": "share of exact truth within the 90 % intervals of poses, moving objects and boxes, by LiDAR",
    "study false-movers": "false movers at fences, hedges and rows of trees over speed and distance",
    "study motion-scenes": "moving points, missed objects and false clusters by LiDAR, frame rate, INS and scene",
    "study jams": "long vehicles in traffic jams, with and without INS: moving points, ids and poses",
    "study fault-detection": "delay and recall of faults of sensors that are named, and false alarms",
    "study growth": "processor time of a frame over beams, points, area and length of the drive",
    "study single-object": "challenges of tracking one object, on scenes with exact truth",
    "study tracker-parameters": "gate of 3D-KF and iterations of 3D-MS (App. A.1)",
    "study tracking-results": "tracked objects in the image and in 3D over time (Figs 7.7, 7.8)",
    "study fleet": "many drives by workers that share them: throughput, cost of the engine, deaths of processes",
    "study thesis": "all of 7.2, trained and measured (Tables 7.8 to 7.10, Figs 7.8 to 7.16)",
    "study augmentation": "DepthCN trained without and with augmentation (Table 7.8)",
    "study reflectance-maps": "detectors of sparse, interpolated and wide reflectance maps (Tables B.1 to B.3)",
    "study detector-losses": "a detector trained with each form of the loss",
    "study calibration": "errors of the calibration of LiDAR and camera, found again and noticed",
    "study label-proposals": "proposals of labels beside those of people, by class and distance",
    "study modalities": "precision of sets of modalities by sensor, and the time that they take",
    "study sim-to-real": "a detector trained on more and more synthetic frames",
    "completion": "print a script that completes commands and flags in a shell",
    "bench": "time every stage beside its reference implementation and the best library; in the source tree",
}
GROUPS = ("evaluate", "batch", "train", "study")
_STAGES = ("ground", "obstacles", "poses", "datmo", "otd", "vehicles")  # in one module


def _command(name: str, summary: str) -> Command:
    group, _, last = name.rpartition(" ")
    function = name.replace(" ", "_")
    if group == "batch":
        own = "batch_synth" if last == "synth" else "batch"
        return BatchCommand(f"perception.cli.batch:{own}", summary)
    if group == "train" and last in TRAININGS:
        return TrainingCommand(last, summary)
    if group == "study":
        study = last.replace("-", "_")
        return Command(f"benchmarks.studies.{study}:{study}", summary)
    room = "benchmarks" if name == "bench" else "perception.cli"
    module = "evaluate_stages" if group == "evaluate" and last in _STAGES else function
    return Command(f"{room}.{module}:{function}", summary)


COMMANDS: Mapping[str, Command] = {
    name: _command(name, summary) for name, summary in SUMMARIES.items() if name not in GROUPS
}

_HELP = """usage: trifuse COMMAND [flags]

{commands}

Start with:  trifuse demo
Then:        trifuse run path/to/2011_09_26/2011_09_26_drive_0005_sync --out results/0005
Help:        trifuse COMMAND --help
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return 0, 2 where the user has to act, or 130 after an interrupt."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    prog = f"trifuse {_command_of(words) or ' '.join(words[:1])}".rstrip()
    # Of libraries, warnings alone: what matplotlib caches is no news to a user.
    logging.basicConfig(handlers=[_LogHandler()], format="%(message)s")
    for room in ("perception", "data", "train", "export", "benchmarks"):
        logging.getLogger(room).setLevel(logging.INFO)
    try:
        if arguments is None:
            signal.signal(signal.SIGTERM, _interrupt)
            atexit.register(_end_at_once)
            if not {"", str(Path.cwd())} & set(sys.path):
                # Processes that libraries start find no modules in the working folder either.
                os.environ["PYTHONSAFEPATH"] = "1"
        run_command_line(words)
        sys.stdout.flush()
        return 0
    except PerceptionError as error:
        _print_error(f"{prog}: {error}")
        return 2
    except KeyboardInterrupt as stopped:
        advice = str(stopped) or _how_to_go_on(words)
        _print_error(f"{prog}: stopped; what is complete is kept; {advice}")
        return 130
    except BrokenPipeError:  # the reader, such as `head`, has enough
        return 0
    except OSError as error:
        from perception.atomic_file import write_error

        _print_error(f"{prog}: {write_error(error.filename or 'output', error)}")
        return 2
    finally:
        _flush_output()


def _interrupt(*_: object) -> None:
    """End at SIGTERM, by which services and jobs are stopped, as at Ctrl-C."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise KeyboardInterrupt


def _end_at_once() -> None:
    """After SIGTERM, end when all is closed: what the interpreter then frees one by one takes seconds."""
    if signal.getsignal(signal.SIGTERM) == signal.SIG_IGN:
        os._exit(130)


def _flush_output() -> None:
    """Write what is buffered, or drop it where nothing takes it."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class _LogHandler(logging.Handler):
    """Writes each record as a line of stderr, above the progress bars."""

    def emit(self, record: logging.LogRecord) -> None:
        from perception.cli.progress import write_line

        write_line(self.format(record))


def _print_error(sentence: str) -> None:
    """Print a sentence on a line of its own, below the progress bars."""
    from perception.cli.progress import close_bars

    close_bars()
    print(sentence, file=sys.stderr)


def run_command_line(words: Sequence[str]) -> None:
    """Run the command that the words call, or print help.

    Raises:
        PerceptionError: The user has to act.
    """
    if not words or words[0] in ("-h", "--help", "help"):
        print(_HELP.format(commands=_lines(_top_level())))
        return
    if words[0] == "--version":
        print(f"trifuse {__version__}")
        return
    if (name := _command_of(words)) is not None:
        rest = words[len(name.split()) :]
        if {"-h", "--help", "--help-all"} & set(rest):
            print(COMMANDS[name].help(name, everything="--help-all" in rest))
        else:
            COMMANDS[name].run(name, rest)
        return
    group, *rest = words
    subcommands = {name: one for name, one in COMMANDS.items() if name.startswith(f"{group} ")}
    if subcommands and (not rest or rest[0] in ("-h", "--help")):
        lines = _lines({name: one.summary for name, one in subcommands.items()})
        print(f"usage: trifuse {group} COMMAND [flags]\n\n{SUMMARIES[group]}:\n\n{lines}")
    else:
        known = [name.removeprefix(f"{group} ") for name in subcommands] or _top_level()
        raise UsageError(
            "command line",
            expected=f"one of {', '.join(known)}",
            found=rest[0] if subcommands else group,
        )


def _command_of(words: Sequence[str]) -> str | None:
    """Return the command that the words begin with."""
    begun = (" ".join(words[:count]) for count in (2, 1))
    return next((name for name in begun if name in COMMANDS), None)


def _how_to_go_on(words: Sequence[str]) -> str:
    name = _command_of(words)
    flags = {} if name is None else COMMANDS[name].flags()
    if "resume" in flags:
        return "repeat the command with --resume to go on, or with --overwrite"
    return "repeat the command" + (" with --overwrite" if "overwrite" in flags else "")


def _top_level() -> dict[str, str]:
    return {name: summary for name, summary in SUMMARIES.items() if " " not in name}


def _lines(summaries: Mapping[str, str]) -> str:
    return "\n".join(f"  {one:<{max(map(len, summaries))}}  {summaries[one]}" for one in summaries)
