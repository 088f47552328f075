"""Atomic writing of files: at any time, either the complete old file or the complete new file exists."""

import errno
import os
from pathlib import Path

from sar_compiler.errors import SarError
from sar_compiler.tree.content import real_path


class WriteError(SarError):
    """A file cannot or must not be written."""


def same_file(one: Path, other: Path) -> bool:
    """Return whether two paths refer to the same file."""
    try:
        return one.samefile(other)
    except OSError:
        return False


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, like `write_bytes`."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file atomically, and preserve its permissions. If the path is a link, its target is written.

    Raises:
        WriteError: If the file cannot be written. The file is then unchanged.
    """
    target = real_path(path)
    try:
        if target.is_symlink():
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))  # noqa: TRY301 - reported like other errors
        if target.exists() and not target.is_file():
            with target.open("wb") as stream:  # a device or a pipe cannot be replaced
                stream.write(data)
        else:
            _replace(target, data)
    except OSError as error:
        raise WriteError(f"cannot write {path}: {error.strerror or error}") from error


def _replace(target: Path, data: bytes) -> None:
    new = target.with_name(f".{target.name}.{os.getpid()}.new")
    try:
        with new.open("xb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        if target.exists():
            new.chmod(target.stat().st_mode & 0o7777)
        new.replace(target)
    except BaseException:
        new.unlink(missing_ok=True)
        raise
