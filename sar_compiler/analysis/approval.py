"""A person's approval of one exact version of a tree, together with its parameters and properties.

An approval covers the tree files, the ID of the tree to run, the mission's parameters, the files that the parameters
name, and the properties file. Approvals are stored in the user's state folder, in a readable file for each tree. If
they were stored next to the tree, an author of trees could write them.
"""

import hashlib
import json
import os
import shlex
import stat
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, NamedTuple

from sar_compiler.errors import SarError
from sar_compiler.missions.mission_start import read_parameters
from sar_compiler.opener import (
    APPROVAL,
    PROPERTIES,
    FileContent,
    UnreadableFileError,
    folder_entries,
    read_file,
)
from sar_compiler.project import ProjectTree
from sar_compiler.resources import state_folder
from sar_compiler.tree.content import encode_text, real_path
from sar_compiler.tree.diagnostic import Source

# The parameters that every ROS node has. They do not concern the mission.
_ROS_PARAMETERS = ("use_sim_time", "start_type_description_service", "qos_overrides")
_TRUSTED_OWNERS = (0,)
"""The IDs of the other users whose files are trusted as much as the current user's own files. Only root is trusted."""
_MAX_LISTED = 3
"""The maximum number of changed parameters that a message names."""


class ApprovalError(SarError):
    """Raised if the current version of a tree is not approved, or an approval cannot be stored, read or revoked."""


class Fingerprint(NamedTuple):
    """The files and parameters that determine a run of a tree.

    Attributes:
        file: The path of the tree file, with symbolic links resolved.
        tree: The ID of the tree to run; empty if the tree has no ID.
        files: The SHA-256 of the tree file, the files that it includes, and the other source files of its set of trees,
            by path relative to the folder of the tree file.
        parameters: The parameters of the mission by flat name, without the parameters that every ROS node has.
        named: The SHA-256 of each file that a parameter names, by parameter.
        properties: The SHA-256 of the properties file; empty if there is none.
    """

    file: Path
    tree: str
    files: Mapping[str, str]
    parameters: Mapping[str, object]
    named: Mapping[str, str]
    properties: str

    @classmethod
    def from_tree(
        cls, tree: ProjectTree, tree_id: str | None, params: Path | None, properties: Path | None
    ) -> "Fingerprint":
        """Return the fingerprint of a loaded tree, even if its files have changed since they were read.

        Args:
            tree: The tree file.
            tree_id: The ID of the tree to run; by default the tree that the file executes.
            params: The parameter file; by default the mission's parameter file.
            properties: The properties file; None for none.

        Raises:
            TreeError: If the file is malformed, has errors, or does not contain the tree.
            ApprovalError: If a file that was read twice changed in between.
            ParameterFileError, ParameterError: If the mission cannot start with the parameters.
            UnreadableFileError: If the properties file cannot be read.
        """
        reader = read_parameters(tree, params, tree_id)
        return cls(
            tree.forest.path,
            _id_of(tree, tree_id),
            _files_of(tree),
            _mission_parameters(reader.parameters),
            _digests(reader.files),
            "" if properties is None else _digest(read_file(properties, PROPERTIES).all_bytes()),
        )

    @property
    def digest(self) -> str:
        """The SHA-256 of the whole fingerprint, except the absolute path of the tree file."""
        return _digest(json.dumps(self[1:], sort_keys=True).encode())


class Approval(NamedTuple):
    """The approval of a tree by a person.

    Attributes:
        file: The path of the tree file.
        by: The name of the person.
        when: The time of the approval, in UTC (ISO 8601).
        digest: The `Fingerprint.digest` of the approved version.
        tree, files, parameters, named, properties: The attributes of the approved version's `Fingerprint`.
    """

    file: str
    by: str
    when: str
    digest: str
    tree: str
    files: Mapping[str, str]
    parameters: Mapping[str, object]
    named: Mapping[str, str]
    properties: str

    def __str__(self) -> str:
        tree = f" ({self.tree})" if self.tree else ""
        return f"{self.file}{tree}: approved by {self.by} on {self.when}, digest {self.digest}"


def approve(fingerprint: Fingerprint, by: str) -> Approval:
    """Store the approval of a tree, and replace any earlier approval of the same tree.

    Args:
        fingerprint: The approved version.
        by: The name of the person.

    Raises:
        ApprovalError: If the approval cannot be stored, or other users can write to the folder of approvals.
    """
    when = datetime.now(timezone.utc).isoformat(timespec="seconds")
    approval = Approval(str(fingerprint.file), by, when, fingerprint.digest, *fingerprint[1:])
    record = _record_path(fingerprint.file, fingerprint.tree)
    try:
        record.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        _require_own_folder()
        record.write_text(f"{json.dumps(approval._asdict(), indent=2)}\n", encoding="utf-8")
        record.chmod(0o600)
    except OSError as error:
        raise ApprovalError(f"cannot store the approval of {fingerprint.file}: {error}") from error
    return approval


def approvals() -> Iterator[Approval]:
    """Yield the user's approvals, sorted by the names of their files.

    Raises:
        ApprovalError: If an approval is unreadable, or other users could have written it.
    """
    for record in _record_paths(""):
        yield _read_record(record)


def revoke(file: Path) -> list[Approval]:
    """Delete the approvals of all trees in a file, and return the deleted approvals.

    Raises:
        ApprovalError: If no tree of the file is approved, or an approval cannot be deleted.
    """
    records = _record_paths(_record_prefix(real_path(file)))
    if not records:
        raise ApprovalError(f"{file} is not approved")
    try:
        revoked = [_read_record(record) for record in records]
        for record in records:
            record.unlink()
    except OSError as error:
        raise ApprovalError(f"cannot revoke the approval of {file}: {error}") from error
    return revoked


class ApprovalCheck:
    """Checks that a run's tree, parameters and monitored properties are approved.

    Args:
        tree: The loaded tree.
        tree_id: The ID of the tree to run; by default the tree that the file executes.
        params: The parameter file in the command line, for the messages.
        properties: The properties file in the command line, for the messages.

    Raises:
        ApprovalError: If this version of the tree is not approved. The message names the changes and the remedy.
        TreeError: If the tree file is malformed.
    """

    def __init__(
        self,
        tree: ProjectTree,
        tree_id: str | None,
        params: Path | None = None,
        properties: Path | None = None,
    ) -> None:
        self._path = tree.path
        self._remedy = f"Review the tree, then run: {approve_command(tree, tree_id, params, properties)}"
        wanted = _id_of(tree, tree_id)
        record = _record_path(real_path(tree.path), wanted)
        if not record.is_file():
            others = [
                each.tree for each in map(_read_record, _record_paths(_record_prefix(real_path(tree.path))))
            ]
            what = f"the tree '{wanted}' of {tree.path}" if others and wanted else str(tree.path)
            instead = f" (approved: {', '.join(others)})" if any(others) else ""
            raise ApprovalError(
                f"{what} is not approved{instead}, but --approved requires an approval. {self._remedy}"
            )
        self._approval = _read_record(record)
        self._reject_changes(_changed_files(_files_of(tree), self._approval.files))

    def require_properties(self, source: Source) -> None:
        """Raise an error if the properties that a run monitors are not the approved properties.

        Args:
            source: The properties file, as it was read.

        Raises:
            ApprovalError: If the content differs from the approved properties file.
        """
        if _digest(encode_text(source, source.text)) != self._approval.properties:
            self._reject_changes([f"{source.path} is not the approved properties file"])

    def require_parameters(self, parameters: Mapping[str, object], files: Mapping[str, FileContent]) -> None:
        """Raise an error if the parameters of a run differ from the approved parameters.

        Args:
            parameters: The parameters of the run's node by flat name, from any source.
            files: The content of the files that the parameters name, by parameter.

        Raises:
            ApprovalError: If a parameter differs, or a file has changed.
        """
        now, then = _mission_parameters(parameters), self._approval.parameters
        changed = [
            f"{name} is {_value_text(now, name)}, but was {_value_text(then, name)}"
            for name in sorted(now.keys() | then.keys())
            if _value_text(now, name) != _value_text(then, name)
        ]
        if len(changed) > _MAX_LISTED:
            changed = [*changed[:_MAX_LISTED], f"and {len(changed) - _MAX_LISTED} more parameters"]
        digests = _digests(files)
        changed += [
            f"{files[name].path} has changed"
            for name in digests
            if digests[name] != self._approval.named.get(name)
        ]
        self._reject_changes(changed)

    def _reject_changes(self, changes: Sequence[str]) -> None:
        if changes:
            approval = self._approval
            raise ApprovalError(
                f"{self._path} differs from the version that {approval.by} approved on {approval.when}: {', '.join(changes)}. {self._remedy}"
            )


def approve_command(
    tree: ProjectTree, tree_id: str | None, params: Path | None, properties: Path | None
) -> str:
    """Return the command line that approves a tree with its parameters and properties."""
    options = {"tree": tree_id, "params": params, "properties": properties}
    words = [f"--{name}={value}" for name, value in options.items() if value is not None]
    return shlex.join(["sar-compile", "approve", str(tree.path), *words])


def _id_of(tree: ProjectTree, tree_id: str | None) -> str:
    element = tree.forest.main_tree(tree_id)
    return tree_id or "" if element is None else element.attributes.get("ID", "")


def _files_of(tree: ProjectTree) -> dict[str, str]:
    forest, files = tree.forest, dict[str, str]()
    for source in (each.source for each in (*forest.files, *forest.others)):
        name = os.path.relpath(real_path(Path(source.path)), forest.path.parent)
        sum_now = _digest(encode_text(source, source.text))
        if files.setdefault(name, sum_now) != sum_now:
            raise ApprovalError(f"{source.path} was changed while it was being read. Run the command again")
    return files


def _changed_files(now: Mapping[str, str], then: Mapping[str, str]) -> list[str]:
    return [
        *(f"{name} has changed" for name in now if name in then and then[name] != now[name]),
        *(f"{name} is new" for name in now.keys() - then.keys()),
        *(f"{name} was removed" for name in then.keys() - now.keys()),
    ]


def _mission_parameters(parameters: Mapping[str, object]) -> dict[str, object]:
    """Return the parameters of the mission as JSON values, with lists instead of ROS's arrays."""
    return {
        name: value if isinstance(value, str) or not isinstance(value, Iterable) else [*value]
        for name, value in parameters.items()
        if name.partition(".")[0] not in _ROS_PARAMETERS
    }


def _value_text(parameters: Mapping[str, object], name: str) -> str:
    return json.dumps(parameters[name]) if name in parameters else "not given"


def _digests(files: Mapping[str, FileContent]) -> dict[str, str]:
    return {name: _digest(content.data) for name, content in files.items()}


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def approval_folder() -> Path:
    """Return the folder of the user's approvals, which contains a file for each approved tree."""
    return state_folder() / "approved"


def _record_prefix(file: Path) -> str:
    return _digest(os.fsencode(file))


def _record_path(file: Path, tree: str) -> Path:
    return approval_folder() / f"{_record_prefix(file)}-{_digest(tree.encode())[:16]}.json"


def _record_paths(prefix: str) -> list[Path]:
    """Return the paths of the approval files whose names begin with the given prefix."""
    folder = approval_folder()
    if not folder.exists():
        return []
    _require_own_folder()
    return [
        each for each in folder_entries(folder) if each.suffix == ".json" and each.name.startswith(prefix)
    ]


def _require_own_folder() -> None:
    """Raise an error if any user except root and the current user can write to the folder of approvals.

    Raises:
        ApprovalError: If other users can write to the folder or replace it.
    """
    folder = real_path(approval_folder())
    about = folder.stat()
    _require_own(folder, about.st_uid, about.st_mode)
    for parent in folder.parents:
        mode = parent.stat().st_mode
        # In a sticky folder such as /tmp only the owner can replace an entry.
        if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            _reject_location(
                parent, "all users can write to that folder", f"chmod o-w {shlex.quote(str(parent))}"
            )


def _require_own(place: Path, owner: int, mode: int) -> None:
    if sys.platform == "win32":
        return
    if owner not in (os.geteuid(), *_TRUSTED_OWNERS):
        _reject_location(place, "it belongs to another user", f"rm -r {shlex.quote(str(place))}")
    if mode & (stat.S_IWGRP | stat.S_IWOTH):
        _reject_location(place, "other users can write to it", f"chmod go-w {shlex.quote(str(place))}")


def _reject_location(place: Path, why: str, how: str) -> None:
    raise ApprovalError(f"approvals in {place} are ignored: {why}. Review the approvals, then run: {how}")


def _read_record(record: Path) -> Approval:
    _require_own_folder()
    try:
        content = read_file(record, APPROVAL)
        data: Any = json.loads(content.decode())
    except UnreadableFileError as error:
        raise ApprovalError(f"cannot read the approvals: {error}") from error
    except (ValueError, RecursionError):
        data = None
    identity = content.identity
    assert identity is not None  # noqa: S101 - only standard input has no identity
    _require_own(record, identity.owner, identity.mode)
    kinds = {"files": dict, "parameters": dict, "named": dict}
    if isinstance(data, dict) and data.keys() == set(Approval._fields):
        approval = Approval(**data)
        if all(isinstance(data[name], kinds.get(name, str)) for name in data):
            return approval
    raise ApprovalError(f"{record} is not a valid approval. Delete it, and approve the tree again")
