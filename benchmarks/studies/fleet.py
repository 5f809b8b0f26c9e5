"""Many drives by `trifuse batch`: throughput of workers, cost of the engine, and results after deaths of processes."""

import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import psutil

from benchmarks.studies.report import RESULTS, formatted_table, publish
from perception.cli.flags import require_positive
from perception.cli.parser import FlagGroup
from perception.errors import DriveError
from perception.render.curve_plots import Curve, CurvePanel, plot_curves

_RECORD = "batch.json"
# What is measured anew in every run: times, and logs of them.
_TIMED = {"summary.json", "frames.jsonl", "timeline.png", "report.html", "report.json", "log.txt"}
_TIMED |= {_RECORD, "config.yaml"}
_POLL_S = 0.2
_MIB = 1 << 20


@dataclass(frozen=True)
class FleetConfig(FlagGroup):
    """Batches.

    Attributes:
        deaths: Number of workers that are killed while they work; the scheduler is killed once, and the command repeated.
        seed: Seed of the moments.
        alone: Whether the drives are also run one by one in one process.
    """

    deaths: int = 5
    seed: int = 0
    alone: bool = True

    def __post_init__(self) -> None:
        """Validate the number of deaths."""
        if self.deaths:
            require_positive("--deaths", self.deaths)


@dataclass
class FleetRun:
    """One way to run all drives.

    Attributes:
        seconds: Time from the start of the command to its end.
        ended_s: (D,) times at which the drives were done, since the start of the command.
        content: Hash of the results of each drive, without what is measured anew.
        scheduler_mib: Memory of the scheduler's process at each look.
    """

    seconds: float
    ended_s: list[float]
    content: dict[str, str]
    scheduler_mib: list[float] = field(default_factory=list)

    @property
    def rate_per_s(self) -> float:
        """Drives a second between the first tenth and the last tenth, when every worker has started and none is idle."""
        skip = max(1, len(self.ended_s) // 10)
        inner = self.ended_s[skip - 1 : len(self.ended_s) - skip]
        return (len(inner) - 1) / (inner[-1] - inner[0]) if len(inner) > 1 else float("nan")


def fleet(drives: list[str], *, config: FleetConfig, out: Path = RESULTS / "fleet.png") -> None:
    """Run drives one by one, by one worker, by two, and by two of which some die; compare times and results.

    The drives are run without video. All of it keeps to one core a worker.

    Example: trifuse study fleet drives/2025_06_01/*_sync

    Args:
        drives: Drives, globs of them, or .txt lists.
        config: Batches.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    from data.batch.drive_sources import find_drives, folder_names

    sources = find_drives(drives)
    if len(sources) < 4:
        found = f"{len(sources)} of {', '.join(drives)}"
        raise DriveError("drives", expected="at least 4, to tell a rate", found=found)
    names = folder_names(sources)
    place = out.with_suffix("")
    runs = {}
    if config.alone:
        words = [
            [str(one.root), *(() if one.sequence is None else ("--sequence", one.sequence))]
            for one in sources
        ]
        runs["one by one"] = _alone(dict(zip(names, words, strict=True)), place / "alone")
    runs["1 worker"] = _batch(drives, place / "one", workers=1)
    runs["2 workers"] = _batch(drives, place / "two", workers=2)
    if config.deaths:
        runs["2 workers that die"] = _batch(drives, place / "deaths", workers=2, config=config)
    first = next(iter(runs.values()))
    one_worker = runs["1 worker"].rate_per_s
    rows = {
        name: [
            len(run.ended_s),
            run.seconds,
            run.rate_per_s,
            run.rate_per_s / one_worker,
            sum(run.content.get(drive) == content for drive, content in first.content.items()),
            float(np.median(run.scheduler_mib[: len(run.scheduler_mib) // 3 + 1] or [np.nan])),
            float(np.median(run.scheduler_mib[-len(run.scheduler_mib) // 3 :] or [np.nan])),
        ]
        for name, run in runs.items()
    }
    title = f"{len(sources)} drives by trifuse batch run"
    curves = [
        Curve(name, run.ended_s, list(range(1, len(run.ended_s) + 1))) for name, run in runs.items()
    ]
    memory = [
        Curve(name, list(np.linspace(0, run.seconds, len(run.scheduler_mib))), run.scheduler_mib)
        for name, run in runs.items()
        if run.scheduler_mib
    ]
    plot_curves(
        out,
        title,
        [
            CurvePanel("drives that are done", "time [s]", "drives", curves),
            CurvePanel("scheduler", "time [s]", "memory [MiB]", memory),
        ],
        columns=2,
    )
    specs = {
        "drives": ".0f", "time [s]": ".1f", "drives/s": ".3f", "relative rate": ".2f", "same results": ".0f",
        "scheduler, first third [MiB]": ".0f", "last third [MiB]": ".0f",
    }  # fmt: skip
    tables = {"runs": formatted_table(title, "", specs, rows)}
    publish(out, "none: the thesis runs one drive", tables, {"drives": drives, "config": config})


def _alone(words_of: dict[str, list[str]], out: Path) -> FleetRun:
    """Run drives one after another in one process of one core."""
    shutil.rmtree(out, ignore_errors=True)
    start_s = time.time()
    process = get_context("spawn").Process(target=_run_all, args=(words_of, out))
    process.start()
    process.join()
    if process.exitcode:
        found = f"a process that ended with {process.exitcode}"
        raise DriveError(out, expected="drives that run", found=found)
    ended_s = sorted(path.stat().st_mtime - start_s for path in out.glob("drives/*/summary.json"))
    return FleetRun(time.time() - start_s, ended_s, _content(out))


def _run_all(words_of: dict[str, list[str]], out: Path) -> None:
    # Before anything is imported that starts threads.
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    from perception.cli.main import run_command_line

    for name, words in words_of.items():
        folder = out / "drives" / name
        with Path(os.devnull).open("w") as log, redirect_stdout(log), redirect_stderr(log):
            run_command_line(["run", *words, "--out", str(folder), "--no-video"])


def _batch(
    drives: Sequence[str], out: Path, workers: int, config: FleetConfig | None = None
) -> FleetRun:
    """Run drives by the command, and kill its processes as the configuration says."""
    shutil.rmtree(out, ignore_errors=True)
    command = [sys.executable, "-m", "perception", "batch", "run", *drives]
    command += ["--out", str(out), "--workers", str(workers), "--no-video"]
    start_s, memory_mib = time.time(), []
    killer = None if config is None else _Killer(config)
    while True:
        process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        scheduler = psutil.Process(process.pid)
        while process.poll() is None:
            time.sleep(_POLL_S)
            done = len(_records(out))
            with suppress(psutil.NoSuchProcess):
                memory_mib.append(scheduler.memory_info().rss / _MIB)
                if killer is not None:
                    killer.kill_next(scheduler, done)
        if process.returncode == -signal.SIGKILL:
            continue  # as a user repeats the command
        if process.returncode:
            assert process.stderr is not None
            raise DriveError(out, expected="drives that run", found=process.stderr.read()[-500:])
        break
    ended_s = sorted(path.stat().st_mtime - start_s for path in _records(out))
    return FleetRun(time.time() - start_s, ended_s, _content(out), memory_mib)


class _Killer:
    """Kills workers, and once the scheduler, each after another drive is done."""

    def __init__(self, config: FleetConfig) -> None:
        self._random = np.random.default_rng(config.seed)
        self._victims = ["worker"] * config.deaths
        self._victims.insert(config.deaths // 2, "scheduler")
        self._next_at = 1

    def kill_next(self, scheduler: psutil.Process, done: int) -> None:
        """Kill the next process where enough drives are done."""
        if not self._victims or done < self._next_at:
            return
        workers = [one for one in scheduler.children() if "spawn_main" in " ".join(one.cmdline())]
        if not workers:
            return
        time.sleep(float(self._random.uniform(0, 1)))
        victim = self._victims.pop(0)
        chosen = (
            scheduler if victim == "scheduler" else workers[self._random.integers(len(workers))]
        )
        chosen.kill()
        self._next_at = done + 1


def _records(out: Path) -> list[Path]:
    return sorted(out.glob(f"drives/*/{_RECORD}"))


def _content(out: Path) -> dict[str, str]:
    """Return a hash of the files of each drive."""
    return {folder.name: _hash(folder) for folder in sorted((out / "drives").iterdir())}


def _hash(folder: Path) -> str:
    digest = hashlib.blake2b(digest_size=16)
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.name not in _TIMED:
            digest.update(str(path.relative_to(folder)).encode() + path.read_bytes())
    return digest.hexdigest()
