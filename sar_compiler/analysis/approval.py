"""A person's approval of an exact version of a tree and its parts.

The parts are its files, the ID of the tree to run, the mission's parameters with the files that they name, and the file of
properties. Records are in the user's state folder, a readable file for each tree. Stored beside the tree, they could be
written by an author of trees.
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

# The parameters of every ROS node, which do not concern the mission.
_OF_ROS = ("use_sim_time", "start_type_description_service", "qos_overrides")
_TRUSTED_OWNERS = (0,)
"""Users whose files count as the user's own: root."""
_SHOWN = 3
"""How many changed parameters a message names."""


class ApprovalError(SarError):
    """The current version of a tree is not approved, or an approval cannot be stored, read or revoked."""


class Fingerprint(NamedTuple):
    """The files and parameters that determine a run of a tree.

    Attributes:
        file: The tree file, with links followed.
        tree: The ID of the tree that is run; empty if it has none.
        files: The SHA-256 of the tree file, of each file that it includes, and of the source files of its set's trees with
            their includes; by their paths from its folder.
        parameters: The parameters of the mission, by their flat names, without those of every ROS node.
        named: The SHA-256 of each file that a parameter names, by the parameter.
        properties: The SHA-256 of the file of properties; empty without one.
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
        """Return the fingerprint of a tree as it was read, even if its files have changed since.

        Args:
            tree: The tree file.
            tree_id: The tree in it; by default the one that the file executes.
            params: The parameter file; by default that of the mission.
            properties: The file of properties, if one is named.

        Raises:
            TreeError: If it is malformed, has errors, or no such tree.
            ApprovalError: If a file that was read twice, also as a part of its set, has changed in between.
            ParameterFileError, ParameterError: If the mission cannot start with the parameters.
            UnreadableFileError: If the file of properties cannot be read.
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
        """The SHA-256 of all parts, which does not depend on their absolute paths."""
        return _digest(json.dumps(self[1:], sort_keys=True).encode())


class Approval(NamedTuple):
    """The approval of a tree by a person.

    Attributes:
        file: The tree file.
        by: The person.
        when: The time, UTC, in ISO 8601.
        digest: The `Fingerprint.digest` at that time.
        tree, files, parameters, named, properties: As `Fingerprint` had them then.
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
    """Store the approval of a tree, and replace an earlier one.

    Args:
        fingerprint: The parts of the tree.
        by: The person.

    Raises:
        ApprovalError: If it cannot be stored, or other users can write there as well.
    """
    when = datetime.now(timezone.utc).isoformat(timespec="seconds")
    approval = Approval(str(fingerprint.file), by, when, fingerprint.digest, *fingerprint[1:])
    record = _record(fingerprint.file, fingerprint.tree)
    try:
        record.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        _require_own_folder()
        record.write_text(f"{json.dumps(approval._asdict(), indent=2)}\n", encoding="utf-8")
        record.chmod(0o600)
    except OSError as error:
        raise ApprovalError(f"cannot store the approval of {fingerprint.file}: {error}") from error
    return approval


def approvals() -> Iterator[Approval]:
    """Yield the approvals, sorted by the names of their records.

    Raises:
        ApprovalError: If a record is unreadable, or other users could have written it.
    """
    for record in _records(""):
        yield _read(record)


def revoke(file: Path) -> list[Approval]:
    """Delete and return the approvals of a file's trees.

    Raises:
        ApprovalError: If none is approved, or a record cannot be deleted.
    """
    records = _records(_name_of(real_path(file)))
    if not records:
        raise ApprovalError(f"{file} is not approved")
    try:
        revoked = [_read(record) for record in records]
        for record in records:
            record.unlink()
    except OSError as error:
        raise ApprovalError(f"cannot revoke the approval of {file}: {error}") from error
    return revoked


class ApprovalCheck:
    """Checks that a run's tree, parameters and monitored properties are approved.

    Args:
        tree: The tree, as it was read.
        tree_id: The tree in the file; by default the one that the file executes.
        params: The parameter file in the command line, for the messages.
        properties: The file of properties in the command line, for the messages.

    Raises:
        ApprovalError: If the tree is not approved as it is; the message says what has changed, and how to approve it.
        TreeError: If it is malformed.
    """

    def __init__(
        self,
        tree: ProjectTree,
        tree_id: str | None,
        params: Path | None = None,
        properties: Path | None = None,
    ) -> None:
        self._path = tree.path
        self._how = f"Review it, then run: {approve_command(tree, tree_id, params, properties)}"
        wanted = _id_of(tree, tree_id)
        record = _record(real_path(tree.path), wanted)
        if not record.is_file():
            others = [each.tree for each in map(_read, _records(_name_of(real_path(tree.path))))]
            what = f"the tree '{wanted}' of {tree.path}" if others and wanted else str(tree.path)
            instead = f" ({', '.join(others)} is)" if any(others) else ""
            raise ApprovalError(f"{what} is not approved{instead}, which --approved requires. {self._how}")
        self._approval = _read(record)
        self._refuse(_changed_files(_files_of(tree), self._approval.files))

    def require_properties(self, source: Source) -> None:
        """Require that the approved properties are monitored in a run.

        Args:
            source: The file of properties, as it was read.

        Raises:
            ApprovalError: If it is another file.
        """
        if _digest(encode_text(source, source.text)) != self._approval.properties:
            self._refuse([f"{source.path} is not the file of properties that was approved"])

    def require_parameters(self, parameters: Mapping[str, object], files: Mapping[str, FileContent]) -> None:
        """Require that a run has the parameters that were approved.

        Args:
            parameters: The parameters of its node by their flat names, from any source.
            files: The files that they name, as read, by the parameter.

        Raises:
            ApprovalError: If it has others, or a file has changed.
        """
        now, then = _mission_parameters(parameters), self._approval.parameters
        changed = [
            f"{name} is {_value_text(now, name)}, but was {_value_text(then, name)}"
            for name in sorted(now.keys() | then.keys())
            if _value_text(now, name) != _value_text(then, name)
        ]
        if len(changed) > _SHOWN:
            changed = [*changed[:_SHOWN], f"and {len(changed) - _SHOWN} more parameters"]
        digests = _digests(files)
        changed += [
            f"{files[name].path} has changed"
            for name in digests
            if digests[name] != self._approval.named.get(name)
        ]
        self._refuse(changed)

    def _refuse(self, changes: Sequence[str]) -> None:
        if changes:
            approval = self._approval
            raise ApprovalError(
                f"{self._path} differs from the version that {approval.by} approved on {approval.when}: {', '.join(changes)}. {self._how}"
            )


def approve_command(
    tree: ProjectTree, tree_id: str | None, params: Path | None, properties: Path | None
) -> str:
    """Return the command line that approves a run."""
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
            raise ApprovalError(f"{source.path} has changed while it was read. Start over")
    return files


def _changed_files(now: Mapping[str, str], then: Mapping[str, str]) -> list[str]:
    return [
        *(f"{name} has changed" for name in now if name in then and then[name] != now[name]),
        *(f"{name} is new" for name in now.keys() - then.keys()),
        *(f"{name} was removed" for name in then.keys() - now.keys()),
    ]


def _mission_parameters(parameters: Mapping[str, object]) -> dict[str, object]:
    """Return parameters as JSON values, with lists instead of ROS's arrays."""
    return {
        name: value if isinstance(value, str) or not isinstance(value, Iterable) else [*value]
        for name, value in parameters.items()
        if name.partition(".")[0] not in _OF_ROS
    }


def _value_text(parameters: Mapping[str, object], name: str) -> str:
    return json.dumps(parameters[name]) if name in parameters else "not given"


def _digests(files: Mapping[str, FileContent]) -> dict[str, str]:
    return {name: _digest(content.data) for name, content in files.items()}


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def approval_folder() -> Path:
    """Return the folder of the user's approvals: a file for each tree."""
    return state_folder() / "approved"


def _name_of(file: Path) -> str:
    return _digest(os.fsencode(file))


def _record(file: Path, tree: str) -> Path:
    return approval_folder() / f"{_name_of(file)}-{_digest(tree.encode())[:16]}.json"


def _records(beginning: str) -> list[Path]:
    """Return the records whose names have a prefix."""
    folder = approval_folder()
    if not folder.exists():
        return []
    _require_own_folder()
    return [
        each for each in folder_entries(folder) if each.suffix == ".json" and each.name.startswith(beginning)
    ]


def _require_own_folder() -> None:
    """Require that only the user, and the system, can write approvals.

    Raises:
        ApprovalError: If other users can.
    """
    folder = real_path(approval_folder())
    about = folder.stat()
    _require_own(folder, about.st_uid, about.st_mode)
    for above in folder.parents:
        mode = above.stat().st_mode
        # In a sticky folder such as /tmp only the owner can replace an entry.
        if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            _refuse_place(above, "all users can write there", f"chmod o-w {shlex.quote(str(above))}")


def _require_own(place: Path, owner: int, mode: int) -> None:
    if sys.platform == "win32":
        return
    if owner not in (os.geteuid(), *_TRUSTED_OWNERS):
        _refuse_place(place, "it belongs to another user", f"rm -r {shlex.quote(str(place))}")
    if mode & (stat.S_IWGRP | stat.S_IWOTH):
        _refuse_place(place, "other users can write there", f"chmod go-w {shlex.quote(str(place))}")


def _refuse_place(place: Path, why: str, how: str) -> None:
    raise ApprovalError(f"approvals in {place} are ignored: {why}. Review the approvals, then run: {how}")


def _read(record: Path) -> Approval:
    _require_own_folder()
    try:
        content = read_file(record, APPROVAL)
        data: Any = json.loads(content.decode())
    except UnreadableFileError as error:
        raise ApprovalError(f"cannot read the approvals: {error}") from error
    except (ValueError, RecursionError):
        data = None
    identity = content.identity
    assert identity is not None  # noqa: S101 - only standard input has none
    _require_own(record, identity.owner, identity.mode)
    kinds = {"files": dict, "parameters": dict, "named": dict}
    if isinstance(data, dict) and data.keys() == set(Approval._fields):
        approval = Approval(**data)
        if all(isinstance(data[name], kinds.get(name, str)) for name in data):
            return approval
    raise ApprovalError(f"{record} is not a valid approval. Delete it, and approve the tree again")
