"""Folders at URLs such as `s3://bucket/frames`, by fsspec; a plain path is a folder of this machine."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from perception.errors import DriveError, UsageError, optional_package, pip_command

_KINDS = "a path, or a URL such as s3://bucket/folder"


class RemoteFolder:
    """Files by name under a URL; a process that is forked, such as one that loads samples, opens its own connection."""

    def __init__(self, url: str) -> None:
        """Take the URL.

        Raises:
            UsageError: There is no such kind of URL, or its package is not installed.
            MissingDependencyError: fsspec is not installed.
        """
        self.url = url.rstrip("/")
        with optional_package("fsspec", needed_for=url, extra="train"):
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

    @property
    def _files(self) -> Any:  # noqa: ANN401 - of fsspec
        if self._process != os.getpid():
            import fsspec

            self._here, self._root = fsspec.url_to_fs(self.url, skip_instance_cache=True)
            self._process = os.getpid()
        return self._here

    def _path(self, name: str) -> str:
        return f"{self._root}/{name}"

    @contextmanager
    def _reaching(self, name: str, expected: str) -> Iterator[None]:
        try:
            yield
        except Exception as error:  # each kind of store has errors of its own
            found = str(error) if str(error) not in ("", self._path(name)) else "no such file"
            raise DriveError(
                f"{self.url}/{name}", expected=expected, found=f"{type(error).__name__}: {found}"
            ) from error
