"""Tests of requirements.lock: `make env` and CI install pinned versions with hashes, which match pyproject.toml."""

import re
import sys
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

REQUIREMENTS = Path("pip_interfaces/requirements.txt")
# `make wheels` builds these wheels; no index has them.
ON_NO_INDEX = {"interfaces"}
PYTHONS = ("3.10", "3.11", "3.12", "3.13")


def pins():
    """Return the entries of the lock: a requirement, and the hashes of its files."""
    entries = re.split(r"\n(?=\S)", Path("requirements.lock").read_text(encoding="utf-8").strip())
    return [
        (Requirement(entry.split(" \\\n")[0]), re.findall(r"--hash=sha256:[0-9a-f]{64}", entry))
        for entry in entries
    ]


def extras():
    return tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"][
        "optional-dependencies"
    ]


def all_requirements():
    project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
    listed = [
        line for line in REQUIREMENTS.read_text(encoding="utf-8").splitlines() if not line.startswith("#")
    ]
    of_extras = [line for name, lines in extras().items() if name not in ON_NO_INDEX for line in lines]
    return [Requirement(line) for line in (*project["dependencies"], *of_extras, *listed)]


def test_each_lock_entry_has_one_version_and_hashes():
    loose = [
        str(pin)
        for pin, hashes in pins()
        if len(pin.specifier) != 1 or "==" not in str(pin.specifier) or not hashes
    ]
    assert loose == []


@pytest.mark.parametrize("python", PYTHONS)
def test_each_requirement_is_pinned_once_at_an_allowed_version(python):
    here = {
        "python_version": python,
        "python_full_version": f"{python}.1",
        "sys_platform": "linux",
        "platform_machine": "x86_64",
    }
    locked: dict[str, list[str]] = {}
    for pin, _hashes in pins():
        if pin.marker is None or pin.marker.evaluate(here):
            locked.setdefault(canonicalize_name(pin.name), []).append(str(pin.specifier).removeprefix("=="))
    for wanted in all_requirements():
        if wanted.marker is None or wanted.marker.evaluate(here):
            [version] = locked.get(canonicalize_name(wanted.name), ["none"])
            assert version != "none", f"{wanted} is not in requirements.lock: run `make lock`"
            assert wanted.specifier.contains(Version(version), prereleases=True), (
                f"{wanted}, and the lock has {version}"
            )


def test_lock_covers_every_extra_on_an_index():
    [named] = re.findall(r"^EXTRAS := (.*)$", Path("Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(named.split()) == sorted(set(extras()) - ON_NO_INDEX)
