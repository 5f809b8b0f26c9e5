"""Dask's workers: processes of this machine, or those of a scheduler that runs already."""

import json
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from perception.errors import UsageError, optional_package

if TYPE_CHECKING:
    from distributed import Client

_CONNECT_S = 10
_THREAD_VARIABLES = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
# Deaths of workers that a drive may be part of before it is given up: machines of a fleet come and go.
_ALLOWED_DEATHS = 10


@dataclass(frozen=True)
class ClusterConfig:
    """Cluster.

    Attributes:
        workers: Number of processes on this machine; else one a core.
        scheduler: Running Dask scheduler whose workers are used instead: its address, such as tcp://10.0.0.5:8786, or the
            .json file that it wrote.
        memory_limit: Memory of a process, such as 4GiB, above which it is started again; else an equal share.
    """

    workers: int | None = None
    scheduler: str | None = None
    memory_limit: str | None = None


def dashboard(client: "Client") -> str:
    """Return where the workers can be watched in a browser."""
    if find_spec("bokeh") is None:
        return "none, as bokeh is not installed"
    return str(client.dashboard_link)


@contextmanager
def open_cluster(config: ClusterConfig) -> Iterator["Client"]:
    """Connect to a scheduler, or start one with processes of one core each.

    Raises:
        UsageError: No scheduler answers at the address, or the number of workers is not positive.
        MissingDependencyError: distributed is not installed.
    """
    with optional_package("distributed", needed_for="trifuse batch", extra="cluster"):
        import dask
        from distributed import Client, LocalCluster
    if config.workers is not None and config.workers < 1:
        raise UsageError("--workers", expected="at least 1", found=str(config.workers))
    dask.config.set(
        {
            "distributed.scheduler.allowed-failures": _ALLOWED_DEATHS,
            # Its profiler interrupts Python a hundred times a second.
            "distributed.worker.profile.enabled": False,
            # Without its threshold of malloc, which gives memory back many times a frame: a fifth of the time.
            "distributed.nanny.pre-spawn-environ": dict.fromkeys(_THREAD_VARIABLES, 1),
        }
    )
    for name in ("distributed", "distributed.client"):  # which has a level of its own
        logging.getLogger(name).setLevel(logging.CRITICAL)  # a death is answered, not reported
    if config.scheduler is not None:
        address = _address(config.scheduler)
        try:
            client = Client(address, timeout=_CONNECT_S)
        except (OSError, ValueError) as error:
            raise UsageError(
                f"--scheduler {config.scheduler}",
                expected="a running Dask scheduler",
                found=f"no answer within {_CONNECT_S} s",
                advice="start one with: dask scheduler",
            ) from error
        with client:
            yield client
        return
    with (
        LocalCluster(
            n_workers=config.workers,
            threads_per_worker=1,
            memory_limit=config.memory_limit or "auto",
            preload="data.batch.one_core",
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


def _address(scheduler: str) -> str:
    """Return the address that a scheduler file names, or the address itself.

    Raises:
        UsageError: The file is missing, or no scheduler wrote it.
    """
    if not scheduler.endswith(".json"):
        return scheduler
    try:
        return str(json.loads(Path(scheduler).read_text())["address"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UsageError(
            f"--scheduler {scheduler}",
            expected="the file of a Dask scheduler",
            found="none that can be read",
            advice=f"start one with: dask scheduler --scheduler-file {scheduler}",
        ) from error
