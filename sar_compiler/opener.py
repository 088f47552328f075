"""The only access to files named by a file, a payload, an agent, an editor or the environment.

Such a file may come from an untrusted source, which may have chosen its name and may replace it at any moment. A check of a path is
therefore worthless for a later access by the path. `read_file` first gets a handle without opening the file (`O_PATH`, which wakes no
device and waits for no writer of a pipe), asks the system for its type and location, and then opens and reads that same file, whatever
has the name by now. `tests/test_house.py` forbids other accesses.
"""

import errno
import os
import stat
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TextIO, TypeVar

from sar_compiler.errors import SarError

if TYPE_CHECKING:
    _PathBase = Path
else:
    _PathBase = type(Path())  # before Python 3.12 only the class of this system's paths can be derived from

STANDARD_INPUT = Path("<stdin>")
"""The path that names standard input, which is read once, and its name in findings."""

_MIB = 2**20
# Where Linux lists the file of each descriptor.
_DESCRIPTORS = Path("/proc/self/fd")
_HANDLE_ONLY: int | None = getattr(os, "O_PATH", None) if _DESCRIPTORS.is_dir() else None
_NOT_BLOCKING: int = getattr(os, "O_NONBLOCK", 0)
_PIPE_SEC = 0.5
"""Interval at which a file opened by another library is checked, seconds: a pipe in its place would block."""
_ATTEMPTS = 10
"""Number of attempts for a file that is replaced at the moment of opening, as editors do when they save."""


class _CanClose(Protocol):
    """An object opened by another library."""

    def close(self) -> object:
        """Close it."""


_Closable = TypeVar("_Closable", bound=_CanClose)


class UnreadableFileError(SarError):
    """A file does not exist, or cannot or must not be read.

    Attributes:
        path: The file, as named.
        reason: The reason.
    """

    def __init__(self, path: Path, reason: str, message: str = "") -> None:
        self.path, self.reason = path, reason
        super().__init__(message or f"cannot read {path}: {reason}")


class PathOutsideError(UnreadableFileError):
    """A file is outside the folders from which it may be read."""


class MissingFileError(UnreadableFileError):
    """A file does not exist."""


class FileKind(NamedTuple):
    """A kind of file.

    Attributes:
        name: Its name in messages.
        limit: The largest number of bytes read.
        is_installed: Whether it belongs to an installed package, so that a confined process may also read it.
    """

    name: str
    limit: int
    is_installed: bool = False


TREE = FileKind("tree file", 32 * _MIB)
"""A tree file or a palette; 100,000 leaves need about a third of this."""
DOCUMENT = FileKind("file beside a tree", _MIB)
"""People write these files, and each value takes some thousand times its characters in memory."""
SETTINGS = DOCUMENT._replace(name="settings file")
PROPERTIES = DOCUMENT._replace(name="file of properties")
SCENARIO = DOCUMENT._replace(name="scenario")
WORLD = DOCUMENT._replace(name="world")
MAP = DOCUMENT._replace(name="map")
PARAMETERS = FileKind("parameter file", _MIB)
"""Sufficient for about 30,000 parameters."""
IMAGE = FileKind("image of a map", 64 * _MIB)
RECORDED_OUTPUT = FileKind("recorded output", 32 * _MIB)
APPROVAL = FileKind("record of an approval", 4 * _MIB)
POSES = FileKind("file of poses", _MIB)
RESERVE = FileKind("reserve of a journal", 128 * 1024)
MODULE = FileKind("module of leaves", 32 * _MIB, is_installed=True)
METADATA = FileKind("package metadata", _MIB, is_installed=True)


class FileIdentity(NamedTuple):
    """Identity and state of a file that was read: equal for two reads of one file without a write in between.

    Attributes:
        device: The number of the file system.
        inode: The file's number in it.
        size: Its size, bytes.
        modified_ns: Time of the last write, nanoseconds since 1970.
        owner: The user who owns it.
        mode: Its type and permissions (`st_mode`).
    """

    device: int
    inode: int
    size: int
    modified_ns: int
    owner: int
    mode: int


class FileContent(NamedTuple):
    """The content of a file, as it was read.

    Attributes:
        path: The file's path, as named by the user or a file.
        real_path: Its path with links followed.
        data: Its bytes, at most one more than its kind's limit.
        identity: Its identity; None for standard input.
        kind: Its kind.
    """

    path: Path
    real_path: Path
    data: bytes
    identity: FileIdentity | None
    kind: FileKind

    def __repr__(self) -> str:
        return f"<content of {self.path}>"

    def all_bytes(self) -> bytes:
        """Return the bytes of the whole file.

        Raises:
            UnreadableFileError: If it is larger than its kind's limit.
        """
        if len(self.data) > self.kind.limit:
            limit = f"{self.kind.limit // _MIB} MiB"
            raise UnreadableFileError(
                self.path, f"it is larger than {limit}, the limit of a {self.kind.name}"
            )
        return self.data

    def decode(self) -> str:
        """Return the text of a file in UTF-8, without its byte order mark.

        Raises:
            UnreadableFileError: If it is larger than its kind's limit, or not UTF-8.
        """
        try:
            return self.all_bytes().decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise UnreadableFileError(self.path, f"it is not UTF-8 text (byte {error.start})") from error


class NamedPath(_PathBase):
    """A path named by a file or a payload: when read, the file must be below certain folders, with links followed.

    It behaves like any other path, and carries the folders from the check to the opening. Paths derived
    from it (`parent`, `/`) carry none.

    Attributes:
        beneath: The folders; None for any.
    """

    beneath: tuple[Path, ...] | None = None

    @classmethod
    def confined_to(cls, path: Path, folders: Iterable[Path]) -> "NamedPath":
        """Return a path of a file that must be below one of some folders."""
        named = cls(path)
        named.beneath = tuple(folders)
        return named

    def __reduce__(self) -> Any:
        # pathlib's own method loses the folders, so another process would read any file.
        return _named_path, (str(self), self.beneath)


def _named_path(path: str, beneath: tuple[Path, ...] | None) -> NamedPath:
    named = NamedPath(path)
    named.beneath = beneath
    return named


class FileQuery(NamedTuple):
    """A query of the file system.

    Attributes:
        kind: The function that answers it, by its name in `_ASKED`.
        path: The path, as passed to the function.
        limit: Largest number of bytes read of a file; 0 for other queries.
    """

    kind: str
    path: str
    limit: int = 0


class Observation(dict[FileQuery, str]):
    """The file-system queries of a computation with their answers: its result is valid as long as these are.

    Answers are short: for a file, the SHA-256 of its content, and its location. Queries of missing files are included.

    Attributes:
        is_consistent: Whether each repeated query had the same answer.
    """

    is_consistent = True

    def record(self, question: FileQuery, answer: str) -> None:
        """Add a query."""
        if self.setdefault(question, answer) != answer:
            self.is_consistent = False

    def is_current(self) -> bool:
        """Return whether every query still has the same answer."""
        now = Observation()
        with now.recording():
            for question, answer in self.items():
                kind, path, limit = question
                with suppress(UnreadableFileError):
                    _ASKED[kind](path, limit)
                if now.get(question) != answer:
                    return False
        return True

    @contextmanager
    def recording(self) -> Iterator[None]:
        """Record the queries made in the block; of nested observations, the innermost one records."""
        global _observation  # noqa: PLW0603 - queries are made everywhere, and results do not depend on it
        before, _observation = _observation, self
        try:
            yield
        finally:
            _observation = before


_observation: Observation | None = None


def mark_unrepeatable() -> None:
    """Exclude the current computation from the cache, because it depends on more than file-system queries."""
    if _observation is not None:
        _observation.is_consistent = False


def digest(data: bytes) -> str:
    """Return the BLAKE2b of bytes, as hexadecimal digits."""
    # Most commands need none, and `hashlib` loads OpenSSL, which takes ten times as long.
    try:
        from _blake2 import blake2b
    except ImportError:
        from hashlib import blake2b

    return blake2b(data, digest_size=32).hexdigest()


def _record(kind: str, path: str | Path, answer: str, limit: int = 0) -> None:
    if _observation is not None:
        _observation.record(FileQuery(kind, str(path), limit), answer)


def is_file(path: str | Path) -> bool:
    """Return whether a regular file exists; False for an impossible name, for which pathlib's `is_file` raises."""
    found = os.path.isfile(path)  # noqa: PTH113 - see above
    _record("file", path, str(found))
    return found


def is_folder(path: str | Path) -> bool:
    """Return whether a folder exists; False for an impossible name."""
    found = os.path.isdir(path)  # noqa: PTH112
    _record("folder", path, str(found))
    return found


def is_there(path: str | Path) -> bool:
    """Return whether a file or anything else exists; False for an impossible name."""
    found = os.path.exists(path)  # noqa: PTH110
    _record("there", path, str(found))
    return found


def owner_of(path: str | Path) -> int | None:
    """Return the owner of a file or a folder; None if it does not exist."""
    owner = None
    with suppress(OSError, ValueError):
        owner = os.stat(path).st_uid  # noqa: PTH116 - of any path
    _record("owner", path, str(owner))
    return owner


def matching_paths(pattern: str) -> list[str]:
    """Return the paths that match a glob pattern, sorted."""
    import glob

    found = sorted(glob.glob(pattern, recursive=True))  # noqa: PTH207 - of a text
    if _observation is not None:
        _record("glob", pattern, digest(os.fsencode("\0".join(found))))
    return found


def state_of(path: str | Path) -> tuple[int, int]:
    """Return the size of a file in bytes, and the time of its last write in nanoseconds since 1970; zeros if it does not exist."""
    state = 0, 0
    with suppress(OSError, ValueError):
        about = os.stat(path)  # noqa: PTH116 - of any path
        state = about.st_size, about.st_mtime_ns
    _record("state", path, str(state))
    return state


class _Confinement(NamedTuple):
    """The folders that a file must be below, and their name in messages."""

    folders: tuple[Path, ...]
    said: str


_confinement: _Confinement | None = None


def confine(folders: Iterable[Path], said: str) -> None:
    """Restrict this process to files below some folders, until its end; installed files are excepted.

    Args:
        folders: The folders, or single files, with links followed.
        said: Their name in messages.
    """
    global _confinement  # noqa: PLW0603 - it is irreversible, and a process has only one
    _confinement = _Confinement(tuple(folders), said)


def allow_reading(path: Path) -> None:
    """Let a confined process read a file, or the files in a folder, named by an installed component: a mission, a ROS package."""
    global _confinement  # noqa: PLW0603 - as above
    if _confinement is not None:
        real = Path(os.path.realpath(path))
        _confinement = _confinement._replace(folders=(*_confinement.folders, real))


def may_read(folder: Path) -> bool:
    """Return whether this process may read the files in a folder, given with links followed."""
    return _confinement is None or any(folder.is_relative_to(each) for each in _confinement.folders)


def read_file(path: str | Path, kind: FileKind) -> FileContent:
    """Read a file.

    Args:
        path: The file; a `NamedPath` must be below its folders. `STANDARD_INPUT` is read once.
        kind: Its kind.

    Raises:
        PathOutsideError: If it is outside the folders that it must be below.
        UnreadableFileError: If it does not exist, is not a regular file, or cannot be read.
    """
    named = path if isinstance(path, Path) else Path(path)
    if named == STANDARD_INPUT:
        return FileContent(named, named, _read_once(sys.stdin, kind.limit), None, kind)
    try:
        content = _stored_content(named, kind) or _read(named, kind)
    except UnreadableFileError as error:
        _record("read", named, error.reason, kind.limit)
        raise
    if _stored is not None and len(content.data) <= min(kind.limit, _MOST_STORED):
        _stored[str(content.real_path)] = content
    if _observation is not None:
        _record("read", named, f"{digest(content.data)} {content.real_path}", kind.limit)
    return content


@contextmanager
def read_files_once() -> Iterator[None]:
    """Open each small file once in the block, so that all results are about one state of it. Nothing may be written meanwhile."""
    global _stored  # noqa: PLW0603 - files are read everywhere
    before, _stored = _stored, {}
    try:
        yield
    finally:
        _stored = before


_stored: dict[str, FileContent] | None = None
_MOST_STORED = 64 * 1024


def _stored_content(named: Path, kind: FileKind) -> FileContent | None:
    """Return the content of a file that was read before in `read_files_once`; None if it was not, or may not be read."""
    try:
        content = _stored.get(os.path.realpath(named)) if _stored else None
    except ValueError:  # no file can have this name
        return None
    if content is None:
        return None
    folders = named.beneath if isinstance(named, NamedPath) else None
    is_beneath = folders is None or any(content.real_path.is_relative_to(each) for each in folders)
    if not is_beneath or _confinement is not None:
        return None
    return content._replace(path=named, data=content.data[: kind.limit + 1], kind=kind)


def _read(named: Path, kind: FileKind) -> FileContent:
    with _open_regular(named, kind) as (descriptor, real):
        about = os.fstat(descriptor)
        # To the end of the file instead of its size: it may grow, and files of the system have no size.
        parts, left = [], kind.limit + 1
        while left and (part := os.read(descriptor, min(left, _MIB))):
            parts.append(part)
            left -= len(part)
    identity = FileIdentity(
        about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns, about.st_uid, about.st_mode
    )
    return FileContent(named, real, b"".join(parts), identity, kind)


def require_regular(path: str | Path) -> None:
    """Check that a file which another library opens, such as SQLite, is a regular one.

    Raises:
        UnreadableFileError: If it does not exist, is not a regular file, or cannot be read.
    """
    with regular_file(path):
        pass


@contextmanager
def regular_file(path: str | Path) -> Iterator[int]:
    """Hold a regular file open while another library opens it by its name; yield the descriptor for `open_by_name`.

    Raises:
        UnreadableFileError: If it does not exist, is not a regular file, or cannot be read.
    """
    with _open_regular(Path(path), _OF_ANOTHER_LIBRARY) as (descriptor, _):
        yield descriptor


_OF_ANOTHER_LIBRARY = FileKind("file", 0)


def open_by_name(path: Path, descriptor: int, connect: Callable[[], _Closable]) -> _Closable:
    """Let a library that only accepts names open a file, and check that it opened the checked file.

    SQLite replaces links by their targets, even those of `/proc/self/fd`, so it cannot be given a descriptor. It opens a file when it
    connects, and reads nothing before the first statement. In between, this function examines the open files of the process. If the system
    does not list them (`/dev/fd`), the name is looked up again instead, which misses a file that was replaced and restored in
    between.

    Args:
        path: The file.
        descriptor: The checked file, open.
        connect: Opens the file by its name.

    Raises:
        UnreadableFileError: If another file was opened.
    """
    checked, before = _identity(descriptor), _open_files()
    opened = connect()
    after = _open_files()
    with suppress(OSError):
        # No new file: the library has reused a descriptor of this file.
        new = {each.identity for each in after - before} or {checked}
        is_same = checked in new if after else os.path.samestat(path.stat(), os.fstat(descriptor))
        if is_same:
            return opened
    opened.close()
    raise UnreadableFileError(path, "it was replaced while it was opened")


class _OpenFile(NamedTuple):
    """A descriptor of this process, and the device and the number of its file."""

    descriptor: int
    identity: tuple[int, int]


def _identity(descriptor: int) -> tuple[int, int]:
    about = os.fstat(descriptor)
    return about.st_dev, about.st_ino


def _open_files() -> set[_OpenFile]:
    """Return the open files of this process; empty if the system does not list them."""
    found = set()
    with suppress(OSError):
        for name in os.listdir("/dev/fd"):  # noqa: PTH208 - numbers
            with suppress(OSError):  # the descriptor of the list itself
                found.add(_OpenFile(int(name), _identity(int(name))))
    return found


@contextmanager
def release_pipes(*paths: str | Path) -> Iterator[None]:
    """Prevent pipes in place of files from blocking a library that opens them: each gets a writer for a moment."""
    is_open = threading.Event()

    def release() -> None:
        while not is_open.wait(_PIPE_SEC):
            for path in paths:
                with suppress(OSError):
                    if stat.S_ISFIFO(os.stat(path).st_mode):  # noqa: PTH116 - of any path
                        os.close(os.open(path, os.O_RDWR | _NOT_BLOCKING))

    threading.Thread(target=release, name="pipes", daemon=True).start()
    try:
        yield
    finally:
        is_open.set()


def folder_entries(folder: Path) -> list[Path]:
    """Return the entries of a folder, sorted by name.

    Raises:
        PathOutsideError: If it is outside the folders to which this process is confined.
        UnreadableFileError: If it is not a folder, or cannot be read.
    """
    try:
        entries = _entries(folder)
    except UnreadableFileError as error:
        _record("entries", folder, error.reason)
        raise
    if _observation is not None:
        names = "/".join(entry.name for entry in entries)
        _record("entries", folder, digest(os.fsencode(names)))
    return entries


def _entries(folder: Path) -> list[Path]:
    with _convert_system_errors(folder):
        if _confinement is None:
            return sorted(folder.iterdir())
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            _require_beneath(folder, _place_of(handle) or _location_by_name(folder, handle), _confinement)
            return sorted(folder / name for name in os.listdir(handle))  # noqa: PTH208 - of a descriptor
        finally:
            os.close(handle)


_ASKED: Mapping[str, Callable[[str, int], object]] = {
    "entries": lambda path, _: folder_entries(Path(path)),
    "file": lambda path, _: is_file(path),
    "folder": lambda path, _: is_folder(path),
    "glob": lambda path, _: matching_paths(path),
    "owner": lambda path, _: owner_of(path),
    "read": lambda path, limit: read_file(path, FileKind("file", limit, is_installed=True)),
    "state": lambda path, _: state_of(path),
    "there": lambda path, _: is_there(path),
}


@cache
def _read_once(stream: TextIO | None, limit: int) -> bytes:
    if stream is None:
        raise UnreadableFileError(Path("standard input"), "it is closed")
    return stream.buffer.read(limit + 1)


@contextmanager
def _convert_system_errors(path: Path) -> Iterator[None]:
    """Convert errors of the system to errors about a file."""
    try:
        yield
    except FileNotFoundError as error:
        raise MissingFileError(path, error.strerror or str(error)) from error
    except OSError as error:
        raise UnreadableFileError(path, error.strerror or str(error)) from error
    except ValueError as error:  # a zero byte, or half of a character
        raise UnreadableFileError(path, f"no file can have this name ({error})") from error


@contextmanager
def _open_regular(path: Path, kind: FileKind) -> Iterator[tuple[int, Path]]:
    """Open a regular file for reading; yield its descriptor and its location."""
    limits = [] if kind.is_installed or _confinement is None else [_confinement]
    if isinstance(path, NamedPath) and path.beneath is not None:
        limits.append(_Confinement(path.beneath, ", ".join(dict.fromkeys(map(str, path.beneath)))))
    with _convert_system_errors(path):
        descriptor, real = _open(path, limits)
        try:
            yield descriptor, real
        finally:
            os.close(descriptor)


def _open(path: Path, limits: list[_Confinement]) -> tuple[int, Path]:
    for _ in range(_ATTEMPTS):
        try:
            handle = os.open(path, os.O_RDONLY | _NOT_BLOCKING | (_HANDLE_ONLY or 0))
        except OSError:
            # Even the existence and the type of a file stay hidden if it must not be read.
            for each in limits:
                _require_beneath(path, Path(os.path.realpath(path)), each)
            raise
        try:
            mode = os.fstat(handle).st_mode
            place = _place_of(handle) or _location_by_name(path, handle)
            if place is None:  # it was replaced at this moment
                continue
            for each in limits:
                _require_beneath(path, place, each)
            # A pipe of the shell (`<(...)`) has no name, and a writer; a named one may never have a writer.
            is_pipe_of_the_shell = stat.S_ISFIFO(mode) and not place.is_absolute()
            if not is_pipe_of_the_shell:
                require_regular_mode(mode)
            if _HANDLE_ONLY is None:
                return os.dup(handle), place
            descriptor = os.open(_DESCRIPTORS / str(handle), os.O_RDONLY | _NOT_BLOCKING)
            if is_pipe_of_the_shell:
                os.set_blocking(descriptor, True)
            return descriptor, place
        finally:
            os.close(handle)
    raise OSError(errno.EBUSY, "it was repeatedly replaced while it was opened")


def _place_of(handle: int) -> Path | None:
    """Return the location of an open file from the system: without a folder for pipes; None if it is deleted or unknown."""
    try:
        # The path may end with "(deleted)" for two reasons: the file is deleted, or this is part of its name.
        if not os.fstat(handle).st_nlink:
            return None
        return (_DESCRIPTORS / str(handle)).readlink()
    except FileNotFoundError:
        return None


def _location_by_name(path: Path, handle: int) -> Path | None:
    """Return the location of an open file on a system without `/proc`; None if the path now has another file."""
    real = Path(os.path.realpath(path))
    try:
        about = _stat_without_links(real)
    except OSError:  # a part of it is a link by now, or gone
        return None
    return real if os.path.samestat(about, os.fstat(handle)) else None


def _stat_without_links(real: Path) -> os.stat_result:
    """Examine a file by a path without links in any part: one that is replaced meanwhile could lead anywhere.

    Raises:
        OSError: If a part is a link, or missing.
    """
    if os.open not in os.supports_dir_fd:
        return real.lstat()
    search = os.O_DIRECTORY | os.O_NOFOLLOW | getattr(os, "O_SEARCH", os.O_RDONLY)
    folder = os.open(real.anchor, search)
    try:
        for part in real.parts[1:-1]:
            inner = os.open(part, search, dir_fd=folder)
            os.close(folder)
            folder = inner
        return os.stat(real.name, dir_fd=folder, follow_symlinks=False)
    finally:
        os.close(folder)


def _require_beneath(path: Path, place: Path | None, limit: _Confinement) -> None:
    if place is None or not any(place.is_relative_to(folder) for folder in limit.folders):
        raise PathOutsideError(path, f"it is outside {limit.said}")


def require_regular_mode(mode: int) -> None:
    """Check by its mode that an open file is a regular one, for code that opens its own file for writing.

    Raises:
        OSError: If it is not.
    """
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(mode):
        is_device = stat.S_ISCHR(mode) or stat.S_ISBLK(mode)
        what = "device" if is_device else "socket" if stat.S_ISSOCK(mode) else "pipe"
        raise OSError(errno.EINVAL, f"it is a {what}, not a file")
