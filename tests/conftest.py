"""Where the real frames are, for the tests that need them."""

import os
import subprocess
import sys
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
