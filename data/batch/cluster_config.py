"""Workers of a batch."""

from dataclasses import dataclass


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
