"""Safe access to files that are named by a file, a payload, an agent, an editor or the environment.

An untrusted source may have chosen the name of such a file, and may replace the file at any moment. A check by path is therefore worthless
for a later access by the same path. `read_file` first obtains a handle without opening the file (`O_PATH`, which neither activates a device
nor waits for the writer of a pipe), and asks the system for the file's type and location. It then opens and reads this very file, even if
the path leads to another file by then. `tests/test_house.py` forbids all other accesses to such files.
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
    _PathBase = type(
        Path()
    )  # before Python 3.12, only the path class of the current system can be subclassed

STANDARD_INPUT = Path("<stdin>")
"""The path that stands for standard input, and the name of standard input in findings. It is read only once."""

_MIB = 2**20
# The folder in which Linux lists the file of each descriptor.
_DESCRIPTORS = Path("/proc/self/fd")
_HANDLE_ONLY: int | None = getattr(os, "O_PATH", None) if _DESCRIPTORS.is_dir() else None
_NOT_BLOCKING: int = getattr(os, "O_NONBLOCK", 0)
_PIPE_SEC = 0.5
"""The interval, in seconds, of the checks whether a pipe blocks a library that opens a file."""
_ATTEMPTS = 10
"""The number of attempts to open a file that is replaced at the same moment, for example when an editor saves it."""


class _CanClose(Protocol):
    """An object opened by another library."""

    def close(self) -> object:
        """Close the object."""


_Closable = TypeVar("_Closable", bound=_CanClose)


class UnreadableFileError(SarError):
    """A file does not exist, or cannot or must not be read.

    Attributes:
        path: The path of the file, as the user or another file names it.
        reason: The reason why the file cannot be read, as part of a sentence.
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
        name: The name of the kind in messages.
        limit: The maximum number of bytes to read.
        is_installed: Whether such files belong to installed packages. If so, a confined process may read them as well.
    """

    name: str
    limit: int
    is_installed: bool = False


TREE = FileKind("tree file", 32 * _MIB)
"""A tree file or a palette. The size of a file with 100,000 leaves is about a third of the limit."""
DOCUMENT = FileKind("file beside a tree", _MIB)
"""A file that people write. The limit is low, because a value takes about a thousand times the memory of its text."""
SETTINGS = DOCUMENT._replace(name="settings file")
PROPERTIES = DOCUMENT._replace(name="properties file")
SCENARIO = DOCUMENT._replace(name="scenario")
WORLD = DOCUMENT._replace(name="world")
MAP = DOCUMENT._replace(name="map")
PARAMETERS = FileKind("parameter file", _MIB)
"""A ROS 2 parameter file; the limit is sufficient for about 30,000 parameters."""
IMAGE = FileKind("map image", 64 * _MIB)
RECORDED_OUTPUT = FileKind("recorded output", 32 * _MIB)
APPROVAL = FileKind("record of an approval", 4 * _MIB)
POSES = FileKind("pose file", _MIB)
RESERVE = FileKind("journal reserve", 128 * 1024)
MODULE = FileKind("module of leaves", 32 * _MIB, is_installed=True)
METADATA = FileKind("package metadata", _MIB, is_installed=True)


class FileIdentity(NamedTuple):
    """The identity and state of a file that was read. They are equal for two reads of a file without a write in between.

    Attributes:
        device: The number of the file system.
        inode: The file's number in the file system.
        size: The size, in bytes.
        modified_ns: The time of the last write, in nanoseconds since 1970.
        owner: The ID of the user who owns the file.
        mode: The type and permissions (`st_mode`).
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
        path: The file's path, as the user or another file names it.
        real_path: The file's path, with links resolved.
        data: The file's bytes. One byte above the limit of the kind shows that the file is too large.
        identity: The file's identity; None for standard input.
        kind: The kind of the file.
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
            UnreadableFileError: If the file is larger than the limit of its kind.
        """
        if len(self.data) > self.kind.limit:
            limit = self.kind.limit
            size = f"{limit // _MIB} MiB" if limit >= _MIB else f"{limit // 1024} KiB"
            raise UnreadableFileError(self.path, f"it is larger than {size}, the limit of a {self.kind.name}")
        return self.data

    def decode(self) -> str:
        """Return the text of a file in UTF-8, without its byte order mark.

        Raises:
            UnreadableFileError: If the file is larger than the limit of its kind, or not UTF-8.
        """
        try:
            return self.all_bytes().decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise UnreadableFileError(self.path, f"it is not UTF-8 text (byte {error.start})") from error


class NamedPath(_PathBase):
    """A path from a file or a payload that is read only if its file, with links resolved, is below one of the given folders.

    The object behaves like any other path. The code that opens the file checks the folders. Paths derived from this path (`parent`, `/`)
    have no folders.

    Attributes:
        beneath: The folders; None if the file may be in any folder.
    """

    beneath: tuple[Path, ...] | None = None

    @classmethod
    def confined_to(cls, path: Path, folders: Iterable[Path]) -> "NamedPath":
        """Return a path that is read only if its file is below one of the folders."""
        named = cls(path)
        named.beneath = tuple(folders)
        return named

    def __reduce__(self) -> Any:
        # pathlib's own method loses the folders, so another process would be able to read any file.
        return _named_path, (str(self), self.beneath)


def _named_path(path: str, beneath: tuple[Path, ...] | None) -> NamedPath:
    named = NamedPath(path)
    named.beneath = beneath
    return named


class FileQuery(NamedTuple):
    """A query of the file system.

    Attributes:
        kind: The key in `_QUERY_FUNCTIONS` of the function that executes the query.
        path: The path, as passed to the function.
        limit: The maximum number of bytes to read from a file; 0 for other queries.
    """

    kind: str
    path: str
    limit: int = 0


class Observation(dict[FileQuery, str]):
    """The file system queries of a computation, with their results. The computation is valid as long as the results are the same.

    The result of reading a file is stored as a digest of the file's content and location. Queries for missing files are
    included.

    Attributes:
        is_consistent: Whether repeated queries had the same result each time.
    """

    is_consistent = True

    def record(self, query: FileQuery, result: str) -> None:
        """Record a query with its result."""
        if self.setdefault(query, result) != result:
            self.is_consistent = False

    def is_current(self) -> bool:
        """Return whether every query still has the same result."""
        now = Observation()
        with now.recording():
            for query, result in self.items():
                kind, path, limit = query
                with suppress(UnreadableFileError):
                    _QUERY_FUNCTIONS[kind](path, limit)
                if now.get(query) != result:
                    return False
        return True

    @contextmanager
    def recording(self) -> Iterator[None]:
        """Record the queries in the block. If observations are nested, only the innermost one records queries."""
        global _observation  # noqa: PLW0603 - queries are made everywhere, and recording does not change their results
        before, _observation = _observation, self
        try:
            yield
        finally:
            _observation = before


_observation: Observation | None = None


def mark_unrepeatable() -> None:
    """Exclude the current computation from the cache, because it depends on more than file system queries."""
    if _observation is not None:
        _observation.is_consistent = False


def digest(data: bytes) -> str:
    """Return the BLAKE2b digest of bytes, as hexadecimal digits."""
    # Imported late, because most commands need no digest. Importing `hashlib` would load OpenSSL and take ten times as long.
    try:
        from _blake2 import blake2b
    except ImportError:
        from hashlib import blake2b

    return blake2b(data, digest_size=32).hexdigest()


def _record(kind: str, path: str | Path, result: str, limit: int = 0) -> None:
    if _observation is not None:
        _observation.record(FileQuery(kind, str(path), limit), result)


def is_file(path: str | Path) -> bool:
    """Return whether a path is a regular file; False for an invalid name. `Path.is_file` may raise an error for such a name."""
    found = os.path.isfile(path)  # noqa: PTH113 - see above
    _record("file", path, str(found))
    return found


def is_folder(path: str | Path) -> bool:
    """Return whether a path is a folder; False for an invalid name."""
    found = os.path.isdir(path)  # noqa: PTH112
    _record("folder", path, str(found))
    return found


def is_there(path: str | Path) -> bool:
    """Return whether a path exists; False for an invalid name."""
    found = os.path.exists(path)  # noqa: PTH110
    _record("there", path, str(found))
    return found


def owner_of(path: str | Path) -> int | None:
    """Return the ID of the user who owns a file or a folder; None if it does not exist."""
    owner = None
    with suppress(OSError, ValueError):
        owner = os.stat(path).st_uid  # noqa: PTH116 - the path may be a string
    _record("owner", path, str(owner))
    return owner


def matching_paths(pattern: str) -> list[str]:
    """Return the paths that match a glob pattern, sorted."""
    import glob

    found = sorted(glob.glob(pattern, recursive=True))  # noqa: PTH207 - the pattern is a string
    if _observation is not None:
        _record("glob", pattern, digest(os.fsencode("\0".join(found))))
    return found


def state_of(path: str | Path) -> tuple[int, int]:
    """Return a file's size in bytes, and the time of its last write in nanoseconds since 1970; zeros for a missing file."""
    state = 0, 0
    with suppress(OSError, ValueError):
        about = os.stat(path)  # noqa: PTH116 - the path may be a string
        state = about.st_size, about.st_mtime_ns
    _record("state", path, str(state))
    return state


class _Confinement(NamedTuple):
    """The folders that a file must be in or below, and a description of these folders for messages."""

    folders: tuple[Path, ...]
    description: str


_confinement: _Confinement | None = None


def confine(folders: Iterable[Path], description: str) -> None:
    """Restrict this process, until its end, to installed files and files below the given folders.

    Args:
        folders: The folders, or single files, with links resolved.
        description: A description of the folders for messages.
    """
    global _confinement  # noqa: PLW0603 - a process has only one confinement, which is irreversible
    _confinement = _Confinement(tuple(folders), description)


def allow_reading(path: Path) -> None:
    """Let a confined process read a file or folder that an installed mission or ROS package names."""
    global _confinement  # noqa: PLW0603 - as above
    if _confinement is not None:
        real = Path(os.path.realpath(path))
        _confinement = _confinement._replace(folders=(*_confinement.folders, real))


def may_read(folder: Path) -> bool:
    """Return whether this process may read the files in a folder. Links in the path must be resolved."""
    return _confinement is None or any(folder.is_relative_to(each) for each in _confinement.folders)


def read_file(path: str | Path, kind: FileKind) -> FileContent:
    """Read a file.

    Args:
        path: The path of the file, which for a `NamedPath` must be below the folders of the path. `STANDARD_INPUT` is read only once.
        kind: The kind of the file.

    Raises:
        PathOutsideError: If the file is outside the folders from which it may be read.
        UnreadableFileError: If the file does not exist, is not a regular file, or cannot be read.
    """
    named = path if isinstance(path, Path) else Path(path)
    if named == STANDARD_INPUT:
        return FileContent(named, named, _read_once(sys.stdin, kind.limit), None, kind)
    try:
        content = _stored_content(named, kind) or _read(named, kind)
    except UnreadableFileError as error:
        _record("read", named, error.reason, kind.limit)
        raise
    if _stored is not None and len(content.data) <= min(kind.limit, _MAX_STORED):
        _stored[str(content.real_path)] = content
    if _observation is not None:
        _record("read", named, f"{digest(content.data)} {content.real_path}", kind.limit)
    return content


@contextmanager
def read_files_once() -> Iterator[None]:
    """Read each small file only once in the block, so that all results refer to the same state. The block must not write files."""
    global _stored  # noqa: PLW0603 - files are read everywhere
    before, _stored = _stored, {}
    try:
        yield
    finally:
        _stored = before


_stored: dict[str, FileContent] | None = None
_MAX_STORED = 64 * 1024


def _stored_content(named: Path, kind: FileKind) -> FileContent | None:
    """Return the content of a file that the block of `read_files_once` has read; None if it has not, or must not read the file."""
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
        # Read until the end of the file, not up to its size: the file may grow, and files of the system report no size.
        parts, left = [], kind.limit + 1
        while left and (part := os.read(descriptor, min(left, _MIB))):
            parts.append(part)
            left -= len(part)
    identity = FileIdentity(
        about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns, about.st_uid, about.st_mode
    )
    return FileContent(named, real, b"".join(parts), identity, kind)


def require_regular(path: str | Path) -> None:
    """Check that a file is a regular file, before another library, such as SQLite, opens it.

    Raises:
        UnreadableFileError: If the file does not exist, is not a regular file, or cannot be read.
    """
    with regular_file(path):
        pass


@contextmanager
def regular_file(path: str | Path) -> Iterator[int]:
    """Keep a regular file open while another library opens it by its name. Yield the descriptor for `open_by_name`.

    Raises:
        UnreadableFileError: If the file does not exist, is not a regular file, or cannot be read.
    """
    with _open_regular(Path(path), _OF_ANOTHER_LIBRARY) as (descriptor, _):
        yield descriptor


_OF_ANOTHER_LIBRARY = FileKind("file", 0)


def open_by_name(path: Path, descriptor: int, connect: Callable[[], _Closable]) -> _Closable:
    """Let a library that only accepts names open a file, and check that it opened the checked file.

    SQLite cannot open a file by its descriptor, because it replaces links by their targets, even links in `/proc/self/fd`. It opens a file
    when it connects, but does not read the file before the first statement. In between, this function examines the open files of the
    process. If the system does not list them (`/dev/fd`), the function looks up the name again. It then cannot detect a file that was
    replaced and restored in the meantime.

    Args:
        path: The path of the file.
        descriptor: The descriptor of the checked file.
        connect: A function that opens the file by its name.

    Raises:
        UnreadableFileError: If another file was opened.
    """
    checked, before = _identity(descriptor), _open_files()
    opened = connect()
    after = _open_files()
    with suppress(OSError):
        # If no new file is open, the library uses an existing descriptor of this file.
        new = {each.identity for each in after - before} or {checked}
        is_same = checked in new if after else os.path.samestat(path.stat(), os.fstat(descriptor))
        if is_same:
            return opened
    opened.close()
    raise UnreadableFileError(path, "it was replaced while it was opened")


class _OpenFile(NamedTuple):
    """A descriptor of this process, with the device and the inode of the file."""

    descriptor: int
    identity: tuple[int, int]


def _identity(descriptor: int) -> tuple[int, int]:
    about = os.fstat(descriptor)
    return about.st_dev, about.st_ino


def _open_files() -> set[_OpenFile]:
    """Return the open files of this process; empty if the system does not list them."""
    found = set()
    with suppress(OSError):
        for name in os.listdir("/dev/fd"):  # noqa: PTH208 - the names are numbers
            with suppress(OSError):  # the descriptor of `/dev/fd` itself is closed by now
                found.add(_OpenFile(int(name), _identity(int(name))))
    return found


@contextmanager
def release_pipes(*paths: str | Path) -> Iterator[None]:
    """Prevent pipes at the paths from blocking a library that opens them. Each pipe is repeatedly opened for writing."""
    is_open = threading.Event()

    def release() -> None:
        while not is_open.wait(_PIPE_SEC):
            for path in paths:
                with suppress(OSError):
                    if stat.S_ISFIFO(os.stat(path).st_mode):  # noqa: PTH116 - the path may be a string
                        os.close(os.open(path, os.O_RDWR | _NOT_BLOCKING))

    threading.Thread(target=release, name="pipes", daemon=True).start()
    try:
        yield
    finally:
        is_open.set()


def folder_entries(folder: Path) -> list[Path]:
    """Return the entries of a folder, sorted by name.

    Raises:
        PathOutsideError: If this process is confined to other folders.
        UnreadableFileError: If the path is not a folder, or cannot be read.
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
            location = _location_by_handle(handle) or _location_by_name(folder, handle)
            _require_beneath(folder, location, _confinement)
            return sorted(folder / name for name in os.listdir(handle))  # noqa: PTH208 - a descriptor
        finally:
            os.close(handle)


_QUERY_FUNCTIONS: Mapping[str, Callable[[str, int], object]] = {
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
    """Convert system errors to an `UnreadableFileError` about a file."""
    try:
        yield
    except FileNotFoundError as error:
        raise MissingFileError(path, error.strerror or str(error)) from error
    except OSError as error:
        raise UnreadableFileError(path, error.strerror or str(error)) from error
    except ValueError as error:  # a zero byte, or a lone surrogate
        raise UnreadableFileError(path, f"no file can have this name ({error})") from error


@contextmanager
def _open_regular(path: Path, kind: FileKind) -> Iterator[tuple[int, Path]]:
    """Open a regular file for reading; yield the descriptor and the location of the file."""
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
            # If the file must not be read, the error must not reveal whether the file exists, or its type.
            for each in limits:
                _require_beneath(path, Path(os.path.realpath(path)), each)
            raise
        try:
            mode = os.fstat(handle).st_mode
            location = _location_by_handle(handle) or _location_by_name(path, handle)
            if location is None:  # the file was replaced at this moment
                continue
            for each in limits:
                _require_beneath(path, location, each)
            # A pipe of the shell (`<(...)`) has a writer, but no name. A named pipe may never have a writer.
            is_pipe_of_the_shell = stat.S_ISFIFO(mode) and not location.is_absolute()
            if not is_pipe_of_the_shell:
                require_regular_mode(mode)
            if _HANDLE_ONLY is None:
                return os.dup(handle), location
            descriptor = os.open(_DESCRIPTORS / str(handle), os.O_RDONLY | _NOT_BLOCKING)
            if is_pipe_of_the_shell:
                os.set_blocking(descriptor, True)
            return descriptor, location
        finally:
            os.close(handle)
    raise OSError(errno.EBUSY, "it was repeatedly replaced while it was opened")


def _location_by_handle(handle: int) -> Path | None:
    """Return the location of an open file according to `/proc`.

    Return None if the file is deleted or its location is unknown. The location of a pipe has no folder.
    """
    try:
        # A path that ends with "(deleted)" may belong to a deleted file, or to a file with such a name.
        if not os.fstat(handle).st_nlink:
            return None
        return (_DESCRIPTORS / str(handle)).readlink()
    except FileNotFoundError:
        return None


def _location_by_name(path: Path, handle: int) -> Path | None:
    """Return the location of an open file on a system without `/proc`; None if the path leads to another file by now."""
    real = Path(os.path.realpath(path))
    try:
        about = _stat_without_links(real)
    except OSError:  # a part of the path is a link by now, or missing
        return None
    return real if os.path.samestat(about, os.fstat(handle)) else None


def _stat_without_links(real: Path) -> os.stat_result:
    """Return the status of a file, given a path without links. A part that is replaced by a link is not followed.

    Raises:
        OSError: If a part of the path is a link, or missing.
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


def _require_beneath(path: Path, location: Path | None, limit: _Confinement) -> None:
    if location is None or not any(location.is_relative_to(folder) for folder in limit.folders):
        raise PathOutsideError(path, f"it is outside {limit.description}")


def require_regular_mode(mode: int) -> None:
    """Check that an open file is a regular file, given its mode. Code that opens files for writing calls this function itself.

    Raises:
        OSError: If the file is not a regular file.
    """
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(mode):
        is_device = stat.S_ISCHR(mode) or stat.S_ISBLK(mode)
        kind = "device" if is_device else "socket" if stat.S_ISSOCK(mode) else "pipe"
        raise OSError(errno.EINVAL, f"it is a {kind}, not a file")
