"""What a person has approved to be flown: a tree file with all that it is made of, exactly as it was then.

Records lie in the user's state folder, a readable file for each tree file. Beside the tree, whoever writes trees could write
an approval as well.
"""

import hashlib
import json
import os
import shlex
from collections.abc import Iterator, Mapping
from contextlib import suppress
from datetime import datetime, timezone
from pathlib import Path
from typing import NamedTuple

from sar_compiler.errors import SarError
from sar_compiler.project import LoadedTree
from sar_compiler.resources import state_folder
from sar_compiler.tree.content import bytes_of, real_path


class ApprovalError(SarError):
    """A tree is not approved as it is, or an approval cannot be kept, read or revoked."""


class Fingerprint(NamedTuple):
    """What a tree is made of.

    Attributes:
        file: The tree file, with links followed.
        files: The SHA-256 of it, of each file that it includes, and of those that trees of its set come from with what these
            include; by their paths from its folder.
    """

    file: Path
    files: Mapping[str, str]

    @classmethod
    def of(cls, tree: LoadedTree) -> "Fingerprint":
        """Return what a tree is made of as it was read, whatever has become of the files since.

        Raises:
            TreeError: If it is malformed.
            ApprovalError: If a file that was read twice, as a part of its set as well, has changed between.
        """
        forest, files = tree.forest, dict[str, str]()
        for source in (each.source for each in (*forest.files, *forest.others)):
            name = os.path.relpath(real_path(Path(source.path)), forest.place.parent)
            sum_now = hashlib.sha256(bytes_of(source, source.text)).hexdigest()
            if files.setdefault(name, sum_now) != sum_now:
                raise ApprovalError(f"{source.path} has changed while it was read; begin anew")
        return cls(forest.place, files)

    @property
    def digest(self) -> str:
        """The SHA-256 over the paths and hashes: equal wherever the same files lie in the same way."""
        return hashlib.sha256(json.dumps(self.files, sort_keys=True).encode()).hexdigest()

    def changes_since(self, files: Mapping[str, str]) -> list[str]:
        """Return what is otherwise than in files that were approved."""
        changed = [name for name, each in self.files.items() if name in files and files[name] != each]
        return [
            *(f"{name} has changed" for name in changed),
            *(f"{name} is new" for name in self.files.keys() - files.keys()),
            *(f"{name} is not part of it any more" for name in files.keys() - self.files.keys()),
        ]


class Approval(NamedTuple):
    """That somebody has approved a tree.

    Attributes:
        file: The tree file.
        by: Who.
        when: When, UTC, as ISO 8601 writes it.
        digest: `Fingerprint.digest` of then.
        files: `Fingerprint.files` of then.
    """

    file: str
    by: str
    when: str
    digest: str
    files: Mapping[str, str]


def approve(fingerprint: Fingerprint, by: str) -> Approval:
    """Keep that somebody approves a tree now, instead of what was approved of this file before.

    Args:
        fingerprint: What the tree is made of.
        by: Who.

    Raises:
        ApprovalError: If that cannot be kept.
    """
    file, when = str(fingerprint.file), datetime.now(timezone.utc).isoformat(timespec="seconds")
    approval = Approval(file, by, when, fingerprint.digest, fingerprint.files)
    record = _record(fingerprint.file)
    try:
        record.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        record.write_text(f"{json.dumps(approval._asdict(), indent=2)}\n", encoding="utf-8")
    except OSError as error:
        raise ApprovalError(f"cannot keep that {file} is approved: {error}") from error
    return approval


def approvals() -> Iterator[Approval]:
    """Yield what is approved, by the names of the records.

    Raises:
        ApprovalError: If a record cannot be read.
    """
    for record in sorted(approval_folder().glob("*.json")):
        yield _read(record)


def revoke(file: Path) -> Approval:
    """Forget that a tree file is approved, whatever it has become, and return what was approved.

    Raises:
        ApprovalError: If it is not approved, or the record cannot be deleted.
    """
    record = _record(real_path(file))
    if not record.is_file():
        raise ApprovalError(f"{file} is not approved")
    try:
        approval = _read(record)
        record.unlink()
    except OSError as error:
        raise ApprovalError(f"cannot forget that {file} is approved: {error}") from error
    return approval


def require_approval(tree: LoadedTree) -> None:
    """Hold that a tree is approved exactly as it was read.

    Raises:
        ApprovalError: If it is not; the message says what has changed, and how to approve it.
        TreeError: If it is malformed.
    """
    now, record = Fingerprint.of(tree), _record(real_path(tree.path))
    how = f"look at it, then: sar-compile approve {shlex.quote(str(tree.path))}"
    if not record.is_file():
        raise ApprovalError(f"{tree.path} is not approved, and --approved starts nothing else; {how}")
    approval = _read(record)
    if changes := now.changes_since(approval.files):
        told = ", ".join(changes)
        raise ApprovalError(
            f"{tree.path} is not what {approval.by} approved on {approval.when}: {told}; {how}"
        )


def approval_folder() -> Path:
    """Return the folder of the user's approvals: a file for each tree file."""
    return state_folder() / "approved"


def _record(file: Path) -> Path:
    return approval_folder() / f"{hashlib.sha256(os.fsencode(file)).hexdigest()}.json"


def _read(record: Path) -> Approval:
    try:
        data = json.loads(record.read_text(encoding="utf-8"))
    except OSError as error:
        raise ApprovalError(f"cannot read what is approved: {error}") from error
    except ValueError:
        data = None
    with suppress(TypeError):
        approval = Approval(**data)
        if all(isinstance(each, str) for each in approval[:-1]) and isinstance(approval.files, dict):
            return approval
    raise ApprovalError(f"{record} is no record of an approval: delete it, and approve the tree anew")
