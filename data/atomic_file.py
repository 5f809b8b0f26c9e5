"""Files that are whole, or not there."""

from pathlib import Path


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file under another name and rename it; make its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.part")
    part.write_bytes(data)
    part.replace(path)
