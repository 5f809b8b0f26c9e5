"""Which state of the program something was made with."""

import subprocess
from pathlib import Path

from perception import __version__


def program_revision() -> str:
    """Return the commit of the source tree, marked + where files differ from it; else the version."""
    root = Path(__file__).parents[1]
    if not (root / ".git").exists():
        return __version__
    command = ["git", "-C", str(root), "describe", "--always", "--abbrev=12", "--dirty=+"]
    try:
        said = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return __version__
    return said.stdout.strip()
