"""Read the point cloud of any file by its suffix."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from data.clouds.cloud import Cloud
from data.clouds.numpy_file import read_npy, read_npz
from data.clouds.pcd import read_pcd
from data.clouds.ply import read_ply
from data.clouds.rows_file import read_rows_file
from data.clouds.text_table import read_csv
from perception.errors import ScanError

_READERS: Mapping[str, Callable[[Path, Sequence[str] | None], Cloud]] = {
    ".bin": read_rows_file,
    ".npy": read_npy,
    ".npz": read_npz,
    ".pcd": read_pcd,
    ".ply": read_ply,
    ".csv": read_csv,
}
CLOUD_SUFFIXES = tuple(_READERS)


def read_cloud(path: Path, columns: Sequence[str] | None = None) -> Cloud:
    """Read the points of one file.

    Args:
        path: File with a suffix of `CLOUD_SUFFIXES`.
        columns: Name of each column in order: x, y, z, intensity, ring, t, and _ for one that is not used; else
            the names in the file, or this order where it has none.

    Raises:
        ScanError: The file is of no known format, malformed, cut off, or larger than any scan.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise ScanError(path, expected=f"a file of {', '.join(CLOUD_SUFFIXES)}", found=path.suffix)
    return reader(path, columns)
