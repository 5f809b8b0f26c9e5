"""Markers, threads and shared data of all tests."""

import os

# One thread a process: the test processes share the cores. Set before the numeric libraries load.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import gc
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import pytest
from filelock import FileLock

from data.synthetic.collection import SynthConfig, write_drives
from tests.car_frames import write_car_frames_with_a_gap
from tests.full_disk import SmallDisk

cv2.setNumThreads(1)
gc.disable()  # while the tests are imported: it would take a third of the time

_ROOT = Path(__file__).parents[1]
_KERNELS = _ROOT / "perception" / "kernels"
_SHARED = _ROOT.parent / "shared" / "kitti"
_TRAINING = ("tests/train/", "tests/cli/test_train")
# Modules whose fixtures run whole commands.
_SLOW = (
    "tests/cli/test_run",
    "tests/cli/test_track.py",
    "tests/cli/test_bench.py",
    "tests/cli/test_damaged_drive.py",
    "tests/test_readme.py",
    "tests/export/",
)
# What takes longest starts first, so that no core waits at the end.
_LONGEST = (
    "tests/train/test_",
    "tests/cli/test_train",
    "tests/test_readme.py",
    "tests/test_site.py",
    "tests/benchmarks/test_bench.py",
    "tests/benchmarks/test_revisions.py",
    "tests/data/synthetic/",
    "tests/cli/",
    "tests/pipeline/",
    "tests/test_",
    "tests/export/",
    "tests/localization/",
    "tests/benchmarks/",
)


def pytest_configure(config: pytest.Config) -> None:
    """Let processes take the files in our order, not those with most tests first; compile for them in a fresh clone."""
    config.option.loadscopereorder = False
    starts_others = getattr(config.option, "numprocesses", 0) and not hasattr(config, "workerinput")
    if starts_others and not any(_KERNELS.glob("__pycache__/*.nbc")):
        _compile_kernels()


def _compile_kernels() -> None:
    """Compile all functions by two processes, from both ends: each loads what the other has compiled."""
    modules = ", ".join(f"perception.kernels.{path.stem}" for path in _KERNELS.glob("[!_]*.py"))
    for process in [
        subprocess.Popen([sys.executable, "-c", code], cwd=_ROOT)
        for code in (
            f"import {modules}; perception.kernels.compiled.load_compiled({order})"
            for order in ("iter", "reversed")
        )
    ]:
        process.wait()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the number of kills of what is killed and resumed."""
    parser.addoption(
        "--kills", type=int, default=2, help="random kills a test; 100 in `make reliability`"
    )


@pytest.fixture(scope="session")
def kills(request: pytest.FixtureRequest) -> int:
    """Return how often a test kills what it resumes."""
    number: int = request.config.getoption("--kills")
    return number


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that read real frames, that train, that run whole commands; put the longest first."""
    items.sort(key=lambda item: [not item.nodeid.startswith(start) for start in _LONGEST])
    for item in items:
        if "kitti_root" in getattr(item, "fixturenames", ()):
            item.add_marker("kitti")
        if item.nodeid.startswith(_TRAINING):
            item.add_marker("train")
        if item.nodeid.startswith(_SLOW):
            item.add_marker("slow")


def pytest_collection_finish() -> None:
    """Let the garbage collector run from now on, over what the tests make and not over all that they have imported."""
    gc.freeze()
    gc.set_threshold(5000, 20, 20)
    gc.enable()


@pytest.fixture(scope="session")
def make_once(
    tmp_path_factory: pytest.TempPathFactory, worker_id: str
) -> Callable[[str, Callable[[Path], object]], Path]:
    """Return a function that makes a folder once for all test processes, and returns it.

    Tests may not write to what it returns.
    """
    base = tmp_path_factory.getbasetemp()
    shared = (base if worker_id == "master" else base.parent) / "shared"
    shared.mkdir(exist_ok=True)

    def make(name: str, write: Callable[[Path], object]) -> Path:
        folder, done = shared / name, shared / f"{name}.done"
        with FileLock(shared / f"{name}.lock"):
            if not done.exists():
                write(folder)
                done.touch()
        return folder

    return make


@pytest.fixture(scope="session")
def street(make_once: Callable[[str, Callable[[Path], object]], Path]) -> Path:
    """Return a synthetic raw drive of four frames with images."""
    folder = make_once("street", lambda folder: write_drives(folder, SynthConfig(frames=4)))
    (drive,) = folder.glob("*/*_sync")
    return drive


@pytest.fixture(scope="session")
def tracking_street(make_once: Callable[[str, Callable[[Path], object]], Path]) -> Path:
    """Return the same street as a sequence in KITTI's tracking layout, without images."""
    config = SynthConfig(layout="tracking", frames=4, images=False)
    return make_once("tracking_street", lambda folder: write_drives(folder, config))


@pytest.fixture(scope="session")
def kitti_root() -> Path:
    """Return the root of real KITTI frames: KITTI_ROOT, else unpacked once into the cache folder."""
    if "KITTI_ROOT" in os.environ:
        root = Path(os.environ["KITTI_ROOT"])
        if not root.is_dir():
            pytest.skip(f"KITTI_ROOT={root} is no folder")
        return root
    if not (_SHARED / "unpack.py").is_file():
        pytest.skip("no real frames: set KITTI_ROOT to a folder with raw/, tracking/ and object/")
    cache = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "trifuse"
    cache.mkdir(parents=True, exist_ok=True)
    with FileLock(cache / "kitti.lock"):
        unpack = [sys.executable, str(_SHARED / "unpack.py"), str(cache / "kitti")]
        subprocess.run(unpack, check=True, capture_output=True)
    return cache / "kitti"


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[SmallDisk]:
    """Return a file system of 2 MB; skipped where none may be mounted."""
    folder = tmp_path / "disk"
    folder.mkdir()
    with SmallDisk.mounted(folder, "2m") as disk:
        if disk is None:
            pytest.skip("no small file system can be mounted by this user")
        yield disk


@pytest.fixture
def car_frames(tmp_path: Path) -> Path:
    """Return object frames 0, 2 and 3, without images, with two cars each."""
    return write_car_frames_with_a_gap(tmp_path / "cars")
