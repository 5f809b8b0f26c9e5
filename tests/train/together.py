"""A training in several processes, which have to be begun by a script of their own."""

import os
import subprocess
import sys
from pathlib import Path

_ROOT = Path(__file__).parents[2]


def train_together(script: str, folder: Path) -> list[str]:
    """Run a script that trains into its first argument, FOLDER/out; return the lines that it printed."""
    file = folder / "train_together.py"
    file.write_text(script)
    ran = subprocess.run(
        [sys.executable, str(file), str(folder / "out")],
        cwd=_ROOT,
        env={**os.environ, "PYTHONPATH": str(_ROOT), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=300,  # on a busy machine
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    assert "Warning" not in ran.stderr
    assert "recommended" not in ran.stderr
    return ran.stdout.splitlines()
