"""Where the real frames are, and how tests train."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

_SHARED = Path(__file__).parents[2] / "shared" / "kitti"


@pytest.fixture(scope="session")
def kitti_root() -> Path:
    """Return the root of real KITTI frames: KITTI_ROOT, else unpacked once into a cache folder."""
    if "KITTI_ROOT" in os.environ:
        root = Path(os.environ["KITTI_ROOT"])
        if not root.is_dir():
            pytest.skip(f"KITTI_ROOT={root} is no folder")
        return root
    if not (_SHARED / "unpack.py").is_file():
        pytest.skip("no real frames: set KITTI_ROOT to a folder with raw/, tracking/ and object/")
    cache = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    root = cache / "trifuse" / "kitti"
    subprocess.run(
        [sys.executable, str(_SHARED / "unpack.py"), str(root)], check=True, capture_output=True
    )
    return root


@pytest.fixture
def one_torch_thread() -> Iterator[None]:
    """Share no work of a few milliseconds between threads that have to be waited for."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)
