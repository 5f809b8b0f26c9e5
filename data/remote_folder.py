"""Folders at URLs such as `s3://bucket/frames`, by fsspec; a plain path is a folder of this machine."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from perception.errors import DriveError, UsageError, optional_package, pip_command

_KINDS = "a path, or a URL such as s3://bucket/folder"

_VERSIONS = ("ETag", "etag", "md5Hash", "mtime", "LastModified", "last_modified", "created")


class RemoteFolder:
    """Files by name under a URL; a process that is forked, such as one that loads samples, opens its own connection."""

    def __init__(self, url: str) -> None:
        """Take the URL.

        Raises:
            UsageError: There is no such kind of URL, or its package is not installed.
            MissingDependencyError: fsspec is not installed.
        """
        self.url = url.rstrip("/")
        with optional_package("fsspec", needed_for=url, extra="cluster"):
            import fsspec
        try:
            self._here, self._root = fsspec.url_to_fs(self.url)
        except ImportError as error:
            raise UsageError(
                url,
                expected="a kind of URL whose package is installed",
                found=str(error),
                advice=f"for s3:// install it with: {pip_command('cloud')}",
            ) from error
        except ValueError as error:
            raise UsageError(url, expected=_KINDS, found=str(error)) from error
        self._process = os.getpid()

    def read(self, name: str) -> bytes:
        """Return the content of a file.

        Raises:
            DriveError: It cannot be read.
        """
        with self._reaching(name, "a file that can be read"):
            return bytes(self._files.cat_file(self._path(name)))

    def write(self, name: str, content: bytes) -> None:
        """Write a file, whole or not at all.

        Raises:
            DriveError: It cannot be written.
        """
        with self._reaching(name, "a place that can be written to"):
            files = self._files
            files.makedirs(self._root, exist_ok=True)
            with files.transaction, files.open(self._path(name), "wb") as file:
                file.write(content)

    def has(self, name: str) -> bool:
        """Return whether there is such a file.

        Raises:
            DriveError: The place cannot be reached.
        """
        with self._reaching(name, "a place that can be reached"):
            return bool(self._files.exists(self._path(name)))

    def listing(self) -> list[tuple[str, int, str]]:
        """Return (name, bytes, version) of every file below the URL, by name; the version changes with the content.

        Raises:
            DriveError: There is no file, or the place cannot be reached.
        """
        with self._reaching("", "files that can be listed"):
            found = self._files.find(self._root, detail=True)
        if not found:
            raise DriveError(self.url, expected="files of a drive", found="none")
        return [
            (path.removeprefix(self._root), int(entry["size"] or 0), _version(entry))
            for path, entry in sorted(found.items())
        ]

    def fetch(self, folder: Path) -> None:
        """Copy every file below the URL into a folder of this machine, or the one file at the URL.

        Raises:
            DriveError: A file cannot be read, or the folder has no room.
        """
        with self._reaching("", "files that can be fetched"):
            is_file = self._files.isfile(self._root)
            source = self._root if is_file else f"{self._root}/"
            self._files.get(source, str(folder), recursive=not is_file)

    @property
    def _files(self) -> Any:  # noqa: ANN401 - of fsspec
        if self._process != os.getpid():
            import fsspec

            self._here, self._root = fsspec.url_to_fs(self.url, skip_instance_cache=True)
            self._process = os.getpid()
        return self._here

    def matches(self) -> list[str]:
        """Return the URLs that this one matches, where it is a pattern such as `s3://bucket/drives/*`, in order.

        Raises:
            DriveError: The place cannot be reached.
        """
        with self._reaching("", "a place that can be reached"):
            return [
                str(self._files.unstrip_protocol(one))
                for one in sorted(self._files.glob(self._root))
            ]

    def _path(self, name: str) -> str:
        return f"{self._root}/{name}"

    @contextmanager
    def _reaching(self, name: str, expected: str) -> Iterator[None]:
        try:
            yield
        except Exception as error:  # each kind of store has errors of its own
            found = str(error) if str(error) not in ("", self._path(name)) else "no such file"
            raise DriveError(
                f"{self.url}/{name}".rstrip("/"),
                expected=expected,
                found=f"{type(error).__name__}: {found}",
            ) from error


def is_url(text: str) -> bool:
    """Return whether a text is a URL and not a path."""
    return "://" in text


def _version(entry: Mapping[str, Any]) -> str:
    """Return what changes with the content of a file, by the name that its kind of store has for it."""
    return next((str(entry[name]) for name in _VERSIONS if entry.get(name) is not None), "")
