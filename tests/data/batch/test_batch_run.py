"""Tasks on two workers: drives that fail are rows, dead workers are replaced, finished drives are skipped."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from data.batch.batch_run import OutcomeRows, run_tasks
from data.batch.cluster import ClusterConfig, open_cluster
from data.batch.drive_sources import DriveSource, chunks, find_drives, folder_names
from data.batch.drive_task import DriveOutcome, DriveTask
from perception.errors import DriveError, PerceptionError, UsageError
from tests.car_frames import write_car_frames
from tests.faults import fault


@pytest.fixture(scope="module")
def cluster():
    with open_cluster(ClusterConfig(workers=2)) as client:
        yield client


def task_in(folder: Path, name: str, settings: str = "") -> DriveTask:
    return DriveTask(name, ("run",), folder / "out" / name, settings, folder / name, None)


def outcome_of(task: DriveTask) -> DriveOutcome:
    return DriveOutcome(task.name, "done", 3, 0.5, "key")


def die_once(task: DriveTask) -> DriveOutcome:
    """End the process of the worker from inside, at the first try."""
    try:
        (task.folder / "tried").touch(exist_ok=False)
    except FileExistsError:
        return outcome_of(task)
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError("this process is dead")


def fail_at_b(task: DriveTask) -> DriveOutcome:
    if task.name == "b":
        raise ValueError("two\nlines")
    return outcome_of(task)


def test_every_drive_has_a_row_though_workers_die(cluster, tmp_path):
    tasks = [task_in(tmp_path, name) for name in "abc"]
    for task in tasks:
        task.folder.mkdir(parents=True)
    found = sorted(run_tasks(cluster, die_once, tasks), key=lambda one: one.name)
    assert found == [outcome_of(task) for task in tasks]


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="processes are bound on Linux")
def test_each_worker_keeps_to_one_core(cluster):
    cluster.wait_for_workers(2)  # those that died are started again
    cores = cluster.run(os.sched_getaffinity, 0)
    assert [len(one) for one in cores.values()] == [1, 1]
    assert len(set.union(*cores.values())) == min(2, len(os.sched_getaffinity(0)))


def test_a_scheduler_is_found_by_its_file(cluster, tmp_path):
    path = tmp_path / "scheduler.json"
    # As ``dask scheduler --scheduler-file`` writes it, shortened; the client's own
    # ``write_scheduler_file`` fails once a worker has metrics of a task (tuples as keys).
    path.write_text(json.dumps({"type": "Scheduler", "address": cluster.scheduler.address}))
    with open_cluster(ClusterConfig(scheduler=str(path))) as client:
        assert client.scheduler.address == cluster.scheduler.address


@pytest.mark.parametrize("content", [None, "", "[]", "{}"])
def test_a_file_of_no_scheduler_is_named(tmp_path, content):
    path = tmp_path / "scheduler.json"
    if content is not None:
        path.write_text(content)
    with (
        fault(UsageError, f"--scheduler {path}", advice="dask scheduler --scheduler-file"),
        open_cluster(ClusterConfig(scheduler=str(path))),
    ):
        pass


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="processes are bound on Linux")
@pytest.mark.parametrize(("name", "bound"), [("node7-1", True), ("tcp://10.0.0.5:40123", False)])
def test_workers_of_other_machines_are_bound_by_their_numbers(name, bound):
    code = (
        "import os, sys, types; from data.batch.one_core import dask_setup; "
        "dask_setup(types.SimpleNamespace(name=sys.argv[1])); print(sorted(os.sched_getaffinity(0)))"
    )
    said = subprocess.run(
        [sys.executable, "-c", code, name], capture_output=True, text=True, check=True
    )
    cores = sorted(os.sched_getaffinity(0))
    assert json.loads(said.stdout) == ([cores[1 % len(cores)]] if bound else cores)


def test_an_error_is_the_row_of_its_drive_alone(cluster, tmp_path):
    tasks = [task_in(tmp_path, name) for name in "abc"]
    found = {one.name: one for one in run_tasks(cluster, fail_at_b, tasks)}
    assert {name: one.state for name, one in found.items()} == {
        "a": "done",
        "b": "failed",
        "c": "done",
    }
    assert found["b"].error == "ValueError('two\\nlines')"


def test_a_key_follows_files_and_configuration(tmp_path):
    write_car_frames(tmp_path / "a", frames=2)
    key, frames = task_in(tmp_path, "a").key()
    assert frames == 2
    assert task_in(tmp_path, "a").key()[0] == key
    of_chunk, frames = replace(task_in(tmp_path, "a"), chunk=range(1, 2)).key()
    assert frames == 1
    assert of_chunk != key
    assert task_in(tmp_path, "a", settings="video: true").key()[0] != key
    scan = next((tmp_path / "a").rglob("000000.bin"))
    os.utime(scan, (1, 1))
    assert task_in(tmp_path, "a").key()[0] != key


def test_what_is_finished_is_known_by_its_key(tmp_path):
    task = task_in(tmp_path, "a")
    assert task.finished("key") is None
    task.folder.mkdir(parents=True)
    task.finish(outcome_of(task))
    assert task.finished("key") == outcome_of(task)
    assert task.finished("another") is None
    task.record.write_text("{")
    assert task.finished("key") is None


def test_drives_are_found_by_folders_globs_and_lists(tmp_path, caplog):
    for name in ("a", "b", "c"):
        write_car_frames(tmp_path / name, frames=1)
    listed = tmp_path / "drives.txt"
    listed.write_text(f"# two of them\n{tmp_path}/[ab]\n\n")
    for patterns in ([str(listed)], [f"{tmp_path}/a", f"{tmp_path}/b"], [f"{tmp_path}/[ab]"]):
        assert [one.root.name for one in find_drives(patterns)] == ["a", "b"]
    # As a shell names all that `synth` has written.
    (tmp_path / "config.yaml").touch()
    named = [str(tmp_path / name) for name in ("a", "config.yaml")]
    assert [one.root.name for one in find_drives(named)] == ["a"]
    assert "left out" in caplog.text
    with fault(DriveError, "config.yaml", "a drive", "none"):
        find_drives(named[1:])
    with fault(DriveError, "nowhere/*", found="no path"):
        find_drives(["nowhere/*"])


def test_drives_have_paths_that_hold_in_every_folder(tmp_path, monkeypatch):
    write_car_frames(tmp_path / "a", frames=1)
    monkeypatch.chdir(tmp_path)
    assert [one.root for one in find_drives(["a"])] == [tmp_path / "a"]


def test_folders_of_drives_of_one_name_differ():
    sources = [DriveSource(Path(root), "0000") for root in ("/x/kitti", "/y/kitti", "/y/other")]
    assert folder_names(sources) == ["x-0000", "y-0000-1", "y-0000-2"]
    assert folder_names([DriveSource(Path("/x/a"), None), sources[0]]) == ["a", "0000"]


def test_the_last_chunk_is_shorter():
    assert chunks(10, 0, None, 4) == [range(0, 4), range(4, 8), range(8, 10)]
    assert chunks(10, 3, 5, 4) == [range(3, 7), range(7, 8)]
    assert chunks(10, 10, None, 4) == []
    assert chunks(10, 1, 4, 3, every=2) == [range(1, 7, 2), range(7, 9, 2)]


def test_numbers_of_results_are_columns(tmp_path):
    tasks = [task_in(tmp_path, name) for name in "ab"]
    tasks[0].folder.mkdir(parents=True)
    (tasks[0].folder / "metrics.json").write_text('{"metrics": {"mde_m": 0.25}, "ok": true}')
    outcomes = OutcomeRows(tmp_path, tasks)
    for task in reversed(tasks):
        outcomes.add(outcome_of(task))
    outcomes.write()
    rows = [json.loads(line) for line in (tmp_path / "drives.jsonl").read_text().splitlines()]
    assert [row["name"] for row in rows] == ["a", "b"]
    assert [row.get("metrics.mde_m") for row in rows] == [0.25, None]
    from pyarrow import parquet

    table = parquet.read_table(tmp_path / "drives.parquet")
    assert table["metrics.mde_m"].to_pylist() == [0.25, None]


def test_a_silent_scheduler_is_named(monkeypatch):
    monkeypatch.setattr("data.batch.cluster._CONNECT_S", 0.5)
    with (
        fault(UsageError, "--scheduler tcp://127.0.0.1:9", advice="dask scheduler"),
        open_cluster(ClusterConfig(scheduler="tcp://127.0.0.1:9")),
    ):
        pass
    with fault(UsageError, "--workers", found="0"), open_cluster(ClusterConfig(workers=0)):
        pass


def end_scheduler(task: DriveTask) -> DriveOutcome:
    """End the scheduler at drive b, when the outcome of a is known."""
    if task.name == "a":
        return outcome_of(task)
    while not task.folder.exists():
        time.sleep(0.05)
    os.kill(int(task.settings), signal.SIGKILL)
    raise AssertionError("the client has gone on")


def test_a_scheduler_that_is_lost_ends_the_batch(tmp_path):
    file = tmp_path / "scheduler.json"
    dask = [sys.executable, "-m", "dask"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    own = ["--scheduler-file", str(file)]
    with (
        subprocess.Popen([*dask, "scheduler", *own, "--port", "0", "--no-dashboard"], **quiet) as scheduler,
        subprocess.Popen([*dask, "worker", *own, "--nthreads", "1", "--no-nanny"], **quiet) as worker,
    ):  # fmt: skip
        try:
            while not file.exists() or not file.read_text():
                assert scheduler.poll() is None
                time.sleep(0.05)
            tasks = [task_in(tmp_path, name, str(scheduler.pid)) for name in "ab"]
            with open_cluster(ClusterConfig(scheduler=str(file))) as client:
                client.wait_for_workers(1)
                ended = run_tasks(client, end_scheduler, tasks)
                assert next(ended) == outcome_of(tasks[0])
                tasks[1].folder.mkdir(parents=True)
                with fault(
                    PerceptionError, "scheduler tcp://", expected="2 drives", found="lost after 1"
                ):
                    next(ended)
        finally:
            scheduler.kill()
            worker.kill()
