"""Trainings in processes of their own: killed, resumed, and in two processes.

Each process is forked from one that has imported torch once: python -m tests.train.forked JOBS.json
"""

import importlib
import json
import os
import signal
import socket
import subprocess
import sys
import traceback
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any, Literal

from perception.kernels.compiled import load_compiled

_ROOT = Path(__file__).parents[2]
# Where each kind of training is found; a toy for what takes long.
_KINDS = {
    "detector": "tests.train.toy_images:TOY_DETECTOR",
    "depthcn": "train.verifier.kind:DEPTHCN",
    "fusion": "tests.train.fusion.toy_rows:TOY_FUSION",
}
# What a training imports in its course.
_IMPORTED_LATER = (
    "data.report.training_report",
    "perception.detection.detectors.postprocess",
    "sklearn.preprocessing",
    "tensorboard.backend.event_processing.event_accumulator",
    "torch.utils.tensorboard",
)


@dataclass(frozen=True)
class Job:
    """One training on the CPU.

    Attributes:
        kind: Kind of training: detector, depthcn or fusion.
        out: Folder of the training.
        words: Flags by their full names.
        epochs: Number of epochs.
        resumes: Whether it resumes from the last checkpoint of the folder.
        processes: Number of processes that train together.
        started_by: Who starts the other processes: torchrun, or Lightning itself.
        sees_all: Whether each process gets every batch, in place of its share.
        killed_after: Number of batches after which the process is killed; 0 for none.
    """

    kind: str
    out: str
    words: Sequence[str]
    epochs: int = 2
    resumes: bool = False
    processes: int = 1
    started_by: Literal["torchrun", "lightning"] = "torchrun"
    sees_all: bool = False
    killed_after: int = 0


def run_jobs(jobs: Sequence[Job], folder: Path) -> list[list[int]]:
    """Run trainings one after another; return the exit code of each process, negative for a signal.

    What job N prints is in the file N.log of the folder.
    """
    file = folder / "jobs.json"
    file.write_text(json.dumps([asdict(job) for job in jobs]))
    ran = subprocess.run(
        [sys.executable, "-m", "tests.train.forked", str(file)],
        cwd=_ROOT,
        env={**os.environ, "PYTHONPATH": str(_ROOT), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=500,  # on a busy machine
        check=True,
    )
    codes: list[list[int]] = json.loads(ran.stdout.splitlines()[-1])
    return codes


def _main(file: Path, started: int | None = None) -> None:
    jobs = [Job(**values) for values in json.loads(file.read_text())]
    if started is not None:  # by Lightning
        sys.exit(_train(jobs[started]))
    for kind in dict.fromkeys(job.kind for job in jobs):
        _load(kind)
    for module in _IMPORTED_LATER:
        importlib.import_module(module)
    load_compiled()
    codes = []
    for number, job in enumerate(jobs):
        sys.argv[1:] = [str(file), str(number)]  # for the processes that Lightning starts
        codes.append(_run(job, file.with_name(f"{number}.log")))
    print(json.dumps(codes))


def _load(kind: str) -> Any:
    module, _, name = _KINDS[kind].partition(":")
    return attrgetter(name)(importlib.import_module(module))


def _run(job: Job, log: Path) -> list[int]:
    """Fork the processes of a job; they print into a log."""
    port, children = _free_port(), []
    for rank in range(job.processes if job.started_by == "torchrun" else 1):
        child = os.fork()
        if child == 0:
            output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
            os.dup2(output, 1)
            os.dup2(output, 2)
            if job.processes > 1 and job.started_by == "torchrun":
                _join(rank, job.processes, port)
            os._exit(_train(job))
        children.append(child)
    return [os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child in children]


def _free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def _join(rank: int, processes: int, port: int) -> None:
    """Name this process to Lightning as torchrun does."""
    os.environ |= {
        "TORCHELASTIC_RUN_ID": "tests",
        "MASTER_ADDR": "127.0.0.1",
        "MASTER_PORT": str(port),
        "WORLD_SIZE": str(processes),
        "LOCAL_WORLD_SIZE": str(processes),
        "RANK": str(rank),
        "LOCAL_RANK": str(rank),
        "GROUP_RANK": "0",
    }


def _train(job: Job) -> int:
    """Train in this process; the first one prints the number of steps."""
    from tests.train.toy_images import tiny_network, tiny_network_without_batch_norm
    from tests.train.trainings import cli_of
    from train.detector import networks

    networks.NETWORKS["tiny"] = tiny_network
    networks.NETWORKS["tiny-without-batch-norm"] = tiny_network_without_batch_norm
    if job.sees_all:
        _give_every_batch()
    if job.killed_after:
        _kill_after(job.killed_after)
    devices = [f"--trainer.devices={job.processes}", "--trainer.enable_progress_bar=false"]
    strategy = ["--trainer.strategy=ddp"] if job.processes > 1 else []
    try:
        cli = cli_of(
            _load(job.kind), Path(job.out), *job.words, *devices, *strategy, epochs=job.epochs
        )
        if cli.run("fit", "last" if job.resumes else None) is not None:
            print(f"{cli.trainer.global_step} steps", flush=True)
        return 0
    except BaseException:
        traceback.print_exc()
        return 1


def _give_every_batch() -> None:
    """Let all processes train on all batches: the mean of equal gradients is the gradient of one process."""
    from data.samples.epoch_samplers import DistributedBatchSampler

    init = DistributedBatchSampler.__init__

    def init_whole(self: Any, whole: Any, batch_size: int, process: int, processes: int) -> None:
        del process, processes
        init(self, whole, batch_size, 0, 1)

    DistributedBatchSampler.__init__ = init_whole  # type: ignore[method-assign]


def _kill_after(batches: int) -> None:
    """Kill this process before a batch, without a chance to write or to print anything."""
    from train.trainer import SeedEachStep

    seed, seen = SeedEachStep.on_train_batch_start, 0

    def seed_or_die(self: SeedEachStep, *args: Any) -> None:
        nonlocal seen
        if seen == batches:
            os.kill(os.getpid(), signal.SIGKILL)
        seen += 1
        seed(self, *args)

    SeedEachStep.on_train_batch_start = seed_or_die  # type: ignore[method-assign]


if __name__ == "__main__":
    _main(Path(sys.argv[1]), *map(int, sys.argv[2:]))
