"""The results of checks, which are stored in the user's cache folder for use by later commands.

A result is reused if everything on which it depends is unchanged. The file system queries of the check are stored with
their responses (`opener.Observation`): the contents of files, and the names of missing files. Imported modules of leaves
and libraries count as files that were read. All other dependencies determine the name of the cache file: the options,
the current folder, the versions of this package and of Python, and the installed packages. The cache file contains a
checksum and JSON. A damaged cache file, or one that another user owns, is ignored.
"""

import itertools
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, NamedTuple

from sar_compiler.errors import SarError
from sar_compiler.json_values import json_text, json_value
from sar_compiler.opener import MODULE, FileKind, FileQuery, Observation, digest, read_file, state_of
from sar_compiler.project.command_line_settings import CommandLineSettings
from sar_compiler.resources import cache_folder, shipped_root
from sar_compiler.tree.content import real_path
from sar_compiler.tree.diagnostic import Cause, Diagnostic, Form, Severity, Source, Span
from sar_compiler.tree.model import NO_SPANS, NO_SPANS_OF_YAML


class TextFix(NamedTuple):
    """The fix of a finding; see `checks.fixing.Fix`.

    Attributes:
        number: The index of the finding among the findings of its file.
        start: The offset of the first character to replace.
        end: The offset after the last character to replace.
        text: The replacement.
    """

    number: int
    start: int
    end: int
    text: str


@dataclass(eq=False, repr=False)
class FileCheck:
    """The result of the check of a file.

    Attributes:
        palettes: The findings about the palettes of the file's project.
        findings: The findings about the file, or about the configuration that prevents the check.
        further: The findings of the further checks.
        raised: The findings about ticks that raise an error in a possible run.
        fixes: The fixes of `findings`.
        fixable: The number of fixes that do not overlap.
        used_palettes: The palettes near the file that were used although the user did not name them.
        used_trees: The tree files near the file that were used although the user did not name them.
        notes: Further notes for the user.
        problem: The reason why the file, or a file that it needs, cannot be read; empty if all files can be read.
        spent: The work that exploring the runs of the file has taken, in units of work.
        is_limited: Whether a larger limit could have led to more findings.
        is_cut: Whether the user has stopped the check.
        is_read: Whether the file could be read.
        is_whole: Whether the check is complete.
        sources: The file system queries that were needed to read the file and the files that it includes.
    """

    palettes: list[Diagnostic] = field(default_factory=list)
    findings: list[Diagnostic] = field(default_factory=list)
    further: list[Diagnostic] = field(default_factory=list)
    raised: list[Diagnostic] = field(default_factory=list)
    fixes: list[TextFix] = field(default_factory=list)
    fixable: int = 0
    used_palettes: list[str] = field(default_factory=list)
    used_trees: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    problem: str = ""
    spent: int = 0
    is_limited: bool = False
    is_cut: bool = False
    is_read: bool = False
    is_whole: bool = False
    sources: Observation = field(default_factory=Observation)


FINDINGS_OF_A_CHECK = tuple(each.name for each in fields(FileCheck))[:4]
"""The attributes of a `FileCheck` that contain findings."""


_KIND = FileKind("cache of findings", 32 << 20)
_MOST_FILES, _MOST_BYTES = 40, 128 << 20
"""The maximum number and the maximum total size of the files with results.

The oldest files are deleted first.
"""
_MOST_QUESTIONS = 100_000
_uses = itertools.count()
_RECENT_NS = 30 * 10**9
"""The minimum age of a module's file, in nanoseconds.

If the file is newer, an earlier version of it may have been imported.
"""


def environment_key(options: Sequence[object]) -> str:
    """Return a digest of the environment that determines the findings.

    Args:
        options: The options of the command that determine the findings, as JSON values.
    """
    here = os.stat(os.curdir)  # noqa: PTH116
    variables = [os.environ.get(name) for name in ("HOME", "AMENT_PREFIX_PATH", "PYTHONPATH", "SAR_KERNEL")]
    packages = [
        f"{each}/share/ament_index/resource_index/packages" for each in (variables[1] or "").split(os.pathsep)
    ]
    user = os.geteuid() if hasattr(os, "geteuid") else 0
    folders = [Path(__file__).parents[1], *(shipped_root() / each for each in ("schemas", "config"))]
    known = [
        options,
        [sys.version, sys.platform, variables, user, os.getcwd(), here.st_mode, here.st_uid],  # noqa: PTH109
        [(each, _names_in(each)) for each in (*sys.path, *packages)],
        [(name, *state) for folder in folders for name, *state in _states_in(str(folder))],
    ]
    return digest(json_text(known).encode())


def _names_in(folder: str) -> list[str]:
    """Return the names in a folder, except those that begin with `.` or `_`."""
    with suppress(OSError):
        return sorted(each for each in os.listdir(folder) if each[0] not in "._")  # noqa: PTH208 - returns strings
    return []


def _states_in(folder: str) -> Iterator[tuple[str, int, int]]:
    """Yield the files below a folder with their sizes and modification times.

    Bytecode caches are left out.
    """
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in sorted(entries, key=lambda each: each.name):
            if entry.is_dir():
                yield from _states_in(entry.path) if entry.name != "__pycache__" else ()
            else:
                about = entry.stat()
                yield entry.path, about.st_size, about.st_mtime_ns


class CheckCache:
    """The stored results of checks with the same options in the same environment.

    Args:
        key: The result of `environment_key`.
        named: The digest of the names of all files of the command. A result may depend on these names.
    """

    def __init__(self, key: str, named: str) -> None:
        self._path = cache_folder() / f"{key}.json"
        self._named = named
        self._surroundings = Observation()
        self._reads_set = False
        self._kept: dict[str, Any] = {}
        with suppress(SarError, OSError, ValueError, LookupError, TypeError, AttributeError):
            self._load()

    @classmethod
    def for_settings(cls, additions: CommandLineSettings, options: Sequence[object]) -> "CheckCache | None":
        """Return the cache for checks with given settings; None if their results cannot be cached.

        Args:
            additions: The user's additions to the projects of the files.
            options: Further options that determine the findings, as JSON values.
        """
        # Later checks in the same process reuse earlier responses without a query, so they would not record all
        # dependencies.
        is_first = not next(_uses)
        if (
            not is_first
            or additions.registry is not None
            or not all(isinstance(each, str) for each in additions.nodes)
        ):
            return None
        paths = (additions.models, additions.include_path, map(real_path, additions.folders))
        listed = [[*map(str, each)] for each in paths]
        kind = [
            *options,
            additions.nodes,
            listed,
            additions.mission,
            additions.is_isolated,
            bool(additions.trees),
        ]
        named = [[*map(str, each)] for each in (additions.trees, additions.names)]
        return cls(environment_key(kind), digest(json_text(named).encode()))

    def _load(self) -> None:
        content = read_file(self._path, _KIND)
        checksum, _, text = content.all_bytes().partition(b"\n")
        if digest(text) != checksum.decode() or not _is_own(content.identity):
            return
        data = json_value(text.decode("utf-8", "surrogatepass"))
        if data["named"] in ("", self._named):
            surroundings = observation_from_data(data["surroundings"])
            if surroundings.is_current():
                self._surroundings, self._reads_set, self._kept = (
                    surroundings,
                    bool(data["named"]),
                    data["checks"],
                )
                with suppress(OSError):
                    os.utime(self._path)

    def find(self, path: Path, work: int | None) -> FileCheck | None:
        """Return the stored result for a file if it is still valid; otherwise None.

        Args:
            path: The file.
            work: The limit for exploring the runs of the file, in units of work; None for no limit.
        """
        with suppress(SarError, ValueError, LookupError, TypeError, AttributeError):
            check = check_from_data(self._kept[str(path)])
            if (work is None or check.spent <= work) and check.sources.is_current():
                return check
        return None

    def store(self, checks: Mapping[Path, FileCheck], surroundings: Observation, *, reads_set: bool) -> None:
        """Store the results of checks.

        Args:
            checks: The new results, by file.
            surroundings: The queries of these checks, except for the queries in `sources` of each result.
            reads_set: Whether the results may depend on every file of the command.
        """
        add_modules(surroundings)
        for question, answer in surroundings.items():
            self._surroundings.record(question, answer)
        if not (surroundings.is_consistent and self._surroundings.is_consistent):
            return
        for path, check in checks.items():
            if check.is_whole and not (check.is_limited or check.notes) and check.sources.is_consistent:
                self._kept[str(path)] = check_to_data(check)
            else:
                self._kept.pop(str(path), None)
        data = {
            "named": self._named if reads_set or self._reads_set else "",
            "surroundings": observation_to_data(self._surroundings),
            "checks": self._kept,
        }
        text = json_text(data, separators=(",", ":")).encode()
        if len(self._surroundings) <= _MOST_QUESTIONS and len(text) < _KIND.limit // 2:
            with suppress(SarError, OSError):
                self._write(digest(text).encode() + b"\n" + text)

    def _write(self, data: bytes) -> None:
        from sar_compiler.writing import write_bytes

        folder = self._path.parent
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        write_bytes(self._path, data)
        size = 0
        for number, (_, length, path) in enumerate(
            sorted(((-modified, length, path) for path, length, modified in _states_in(str(folder))))
        ):
            size += length
            if number >= _MOST_FILES or size > _MOST_BYTES:
                Path(path).unlink(missing_ok=True)


def _is_own(identity: Any) -> bool:
    return not hasattr(os, "geteuid") or identity.owner == os.geteuid()


def add_modules(observation: Observation) -> None:
    """Record the imported modules as read files.

    Modules of Python and of this package are left out, because the key covers them.
    """
    standard, own = os.path.dirname(os.__file__), str(Path(__file__).parents[1])  # noqa: PTH120
    with observation.recording():
        for module in [*sys.modules.values()]:
            path = getattr(module, "__file__", None)
            if (
                not isinstance(path, str)
                or path.startswith(f"{own}{os.sep}")
                or FileQuery("state", path) in observation
            ):
                continue
            if path.startswith(standard) and not path.startswith(
                (f"{standard}/site-packages", f"{standard}/dist-packages")
            ):
                continue
            _, modified_ns = state_of(path)
            if path.endswith(".py"):
                if modified_ns > time.time_ns() - _RECENT_NS:
                    observation.is_consistent = False
                with suppress(SarError):
                    read_file(path, MODULE)


def check_to_data(check: FileCheck) -> dict[str, Any]:
    """Convert the result of a check to JSON values."""
    sources: dict[int, tuple[int, Source]] = {}

    def finding(each: Diagnostic) -> list[Any]:
        number, _ = sources.setdefault(id(each.source), (len(sources), each.source))
        advice = [each.suggestion, each.hint, each.severity.value, each.common_cause]
        return [each.code, each.message, number, each.span, *advice]

    data: dict[str, Any] = {
        name: [*map(finding, value)] if name in FINDINGS_OF_A_CHECK else value
        for name, value in vars(check).items()
        if name != "sources" and value
    }
    texts = [[each.path, each.text, each.form.value, each.encoding, each.bom] for _, each in sources.values()]
    return {**data, "sources": observation_to_data(check.sources), "texts": texts}


def check_from_data(data: Mapping[str, Any]) -> FileCheck:
    """Convert JSON values to the result of a check.

    Raises:
        ValueError, LookupError, TypeError: If the values are invalid.
    """
    spans = {Form.XML: NO_SPANS, Form.YAML: NO_SPANS_OF_YAML}
    sources = [
        Source(path, text, spans[Form(form)], encoding, bom)
        for path, text, form, encoding, bom in data["texts"]
    ]

    def finding(each: Sequence[Any]) -> Diagnostic:
        code, message, number, span, suggestion, hint, severity, cause = each
        common = None if cause is None else Cause(*cause)
        return Diagnostic(
            code, message, sources[number], Span(*span), suggestion, hint, Severity(severity), common
        )

    fields = {key: value for key, value in data.items() if key not in ("texts", "sources", "fixes")}
    check = FileCheck(**fields, sources=observation_from_data(data["sources"]))
    for name in FINDINGS_OF_A_CHECK:
        setattr(check, name, [*map(finding, getattr(check, name))])
    check.fixes = [TextFix(*each) for each in data.get("fixes", ())]
    return check


def observation_to_data(observation: Observation) -> dict[str, dict[str, dict[str, str]]]:
    """Convert queries about files, and their responses, to JSON values: responses by kind, limit and path."""
    data: dict[str, dict[str, dict[str, str]]] = {}
    for (kind, path, limit), answer in observation.items():
        data.setdefault(kind, {}).setdefault(str(limit), {})[path] = answer
    return data


def observation_from_data(data: Mapping[str, Mapping[str, Mapping[str, str]]]) -> Observation:
    """Convert JSON values to queries about files, with their responses."""
    return Observation(
        (FileQuery(kind, path, int(limit)), answer)
        for kind, limits in data.items()
        for limit, answers in limits.items()
        for path, answer in answers.items()
    )
