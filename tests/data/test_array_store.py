"""Arrays kept on disk: made once, bounded, and never seen half written."""

import os
import signal
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from data import array_store
from data.array_store import ArrayStore, default_folder, entry_key
from perception.errors import UsageError
from tests.faults import fault


def made(value: int = 0, size: int = 100_000) -> dict[str, np.ndarray]:
    return {"picture": np.full(size, value, np.uint8), "names": np.array(["Car", "Van"])}


def never() -> dict[str, np.ndarray]:
    raise AssertionError("it was there already")


def age(store: ArrayStore, key: str, seconds: float) -> None:
    then = time.time() - seconds
    os.utime(store.folder / key, (then, then))


def test_an_entry_is_made_once_and_read_by_memory_map(store: ArrayStore):
    first = store.get("a", lambda: made(7))
    again = ArrayStore(store.folder).get("a", never)
    for arrays in (first, again):
        assert arrays["picture"].sum() == 700_000
        assert arrays["names"].tolist() == ["Car", "Van"]
    assert isinstance(again["picture"], np.memmap)
    assert not again["picture"].flags.writeable


def test_arrays_without_values_are_kept_too(store: ArrayStore):
    store.get("a", lambda: {"boxes": np.zeros((0, 4)), "focal": np.array(7.0)})
    arrays = store.get("a", never)
    assert arrays["boxes"].shape == (0, 4)
    assert float(arrays["focal"]) == 7.0


def test_a_key_tells_all_facts_apart():
    same = entry_key(a=1, b={"x": [1, 2]})
    assert same == entry_key(b={"x": [1, 2]}, a=1)
    others = [entry_key(a=2, b={"x": [1, 2]}), entry_key(a=1, b={"x": [2, 1]}), entry_key(a=1)]
    assert len({same, *others}) == 4


@pytest.mark.parametrize("damage", ["cut off", "no array", "emptied"])
def test_a_damaged_entry_is_made_again(store: ArrayStore, damage: str, caplog):
    store.get("a", made)
    file = store.folder / "a" / "picture.npy"
    if damage == "emptied":
        for path in file.parent.iterdir():
            path.unlink()
    else:
        file.write_bytes(file.read_bytes()[:5000] if damage == "cut off" else b"nothing")
    assert store.get("a", lambda: made(3))["picture"][0] == 3
    assert store.get("a", never)["picture"][0] == 3
    assert "replaced the damaged cache entry" in caplog.text


def test_what_is_unused_for_longest_goes_first(tmp_path: Path):
    store = ArrayStore(tmp_path / "cache", budget_bytes=350_000)
    for seconds, key in ((300, "a"), (200, "b"), (100, "c")):
        store.get(key, made)
        age(store, key, seconds)
    store.get("a", never)  # used now, though it is the oldest
    store.get("d", made)
    assert [key in store for key in "abcd"] == [True, False, True, True]


def test_an_entry_larger_than_the_budget_stays_until_the_next(tmp_path: Path):
    store = ArrayStore(tmp_path / "cache", budget_bytes=1000)
    store.get("a", made)
    assert "a" in store
    store.get("b", made)
    assert ["a" in store, "b" in store] == [False, True]


def test_what_a_dead_process_left_goes(store: ArrayStore):
    left = store.folder / ".part-dead"
    left.mkdir()
    os.utime(left, (0, 0))
    fresh = store.folder / ".part-alive"
    fresh.mkdir()
    store.get("a", made)
    assert not left.exists()
    assert fresh.exists()


def test_no_file_is_left_of_a_write_that_fails(store: ArrayStore, monkeypatch):
    def full(*args: object, **kwargs: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(array_store.np, "save", full)
    with fault(
        UsageError, expected="room to write to", found="No space left on device", advice="choose"
    ):
        store.get("a", made)
    assert list(store.folder.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path: Path):
    (tmp_path / "file").write_text("")
    with fault(UsageError, where="cache folder", expected="a folder with room"):
        ArrayStore(tmp_path / "file" / "cache")


def test_a_folder_that_vanished_is_an_error(store: ArrayStore):
    store.folder.rmdir()
    with fault(UsageError, found="No such file or directory"):
        store.get("a", made)


def test_a_budget_of_zero_is_refused(tmp_path: Path):
    with fault(UsageError, where="budget of the cache", expected="above zero"):
        ArrayStore(tmp_path, budget_bytes=0)


def test_the_users_cache_folder_is_the_default(monkeypatch, tmp_path: Path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert default_folder() == tmp_path / "trifuse" / "arrays"


def test_another_process_may_be_faster(store: ArrayStore):
    def slow() -> dict[str, np.ndarray]:
        ArrayStore(store.folder).get("a", lambda: made(1))
        return made(2)

    store.get("a", slow)
    assert store.get("a", never)["picture"][0] == 1
    assert [path.name for path in store.folder.iterdir()] == ["a"]


def write_all(folder: Path, budget_bytes: int) -> int:
    store = ArrayStore(folder, budget_bytes)
    return sum(
        int(store.get(str(value), lambda value=value: made(value))["picture"][0])
        for _ in range(3)
        for value in range(8)
    )


@pytest.mark.parametrize("budget_bytes", [10**9, 300_000], ids=["all fits", "entries go"])
def test_processes_that_write_the_same_at_once_all_read_it_whole(tmp_path, budget_bytes):
    with ProcessPoolExecutor(3, mp_context=get_context("fork")) as pool:
        sums = list(pool.map(write_all, [tmp_path] * 3, [budget_bytes] * 3))
    assert sums == [3 * sum(range(8))] * 3
    assert not list(tmp_path.glob(".part-*"))


def die_while_writing(folder: Path) -> None:
    def save_and_die(*args: object, **kwargs: object) -> None:
        save(*args, **kwargs)
        os.kill(os.getpid(), signal.SIGKILL)

    save, np.save = np.save, save_and_die
    ArrayStore(folder).get("a", lambda: made(1))


def test_an_entry_of_a_process_that_was_killed_while_it_wrote_is_made_again(store: ArrayStore):
    process = get_context("fork").Process(target=die_while_writing, args=(store.folder,))
    process.start()
    process.join()
    assert process.exitcode == -signal.SIGKILL
    assert "a" not in store
    assert [path.name.startswith(".part-") for path in store.folder.iterdir()] == [True]
    assert store.get("a", lambda: made(2))["picture"][0] == 2
    assert store.get("a", never)["picture"][0] == 2
