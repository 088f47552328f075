"""What `make release` does beside building: before it, the changelog's section and its commit; after it, the tag.

`python .ci/release.py fill` replaces the placeholders of `release/publication.toml` in all files.
"""

import datetime as dt
import re
import subprocess
import sys
from pathlib import Path

CHANGELOG, CITATION, PUBLICATION = Path("CHANGELOG.md"), Path("CITATION.cff"), "release/publication.toml"
# Where the version stands.
VERSIONED = {
    "pyproject.toml": r'^version = "(.+)"$',
    "package.xml": r"^  <version>(.+)</version>$",
    str(CITATION): r"^version: (.+)$",
    "QUALITY_DECLARATION.md": r"`(\d\S*)` in \[package\.xml\]",
    "release/recipe.yaml": r'^  version: "(.+)"$',
}
UNRELEASED = "## [Unreleased]\n"
KIND = re.compile(r"^### .*", re.DOTALL | re.MULTILINE)


class NotReadyError(Exception):
    """Something has to be done before a release."""


def git(*arguments: str) -> str:
    """Return what git prints.

    Raises:
        NotReadyError: It fails.
    """
    run = subprocess.run(("git", *arguments), capture_output=True, text=True, check=False)  # noqa: S603, S607 - ours
    if run.returncode:
        raise NotReadyError(f"git {arguments[0]}: {run.stderr.strip()}")
    return run.stdout


def version() -> str:
    """Return the version of the project.

    Raises:
        NotReadyError: Files disagree about it.
    """
    said = {
        name: re.findall(pattern, Path(name).read_text(encoding="utf-8"), re.MULTILINE)
        for name, pattern in VERSIONED.items()
    }
    if len({*map(tuple, said.values())}) != 1:
        raise NotReadyError(
            "the versions differ: " + ", ".join(f"{name} has {has}" for name, has in said.items())
        )
    [found] = said["pyproject.toml"]
    return found


def unreleased(changelog: str) -> "tuple[str, str, str]":
    """Return the text of a changelog in three: up to the heading of what is not released, that, and what follows."""
    head, _, rest = changelog.partition(UNRELEASED)
    section, following = re.fullmatch(r"(.*?)(^## .*|\Z)", rest, re.DOTALL | re.MULTILINE).groups()  # type: ignore[union-attr]
    return head, section, following


def with_section(changelog: str, name: str, day: str) -> str:
    """Return the changelog with what is not released under a version; what stands above its first kind is left out.

    Args:
        changelog: Its text.
        name: The version.
        day: Its day, as YYYY-MM-DD.

    Raises:
        NotReadyError: There is nothing to release.
    """
    head, section, following = unreleased(changelog)
    kinds = KIND.search(section)
    if kinds is None:
        raise NotReadyError(f"{CHANGELOG} has nothing under 'Unreleased'")
    return f"{head}{UNRELEASED}\n## [{name}] - {day}\n\n{kinds[0].rstrip()}\n" + (
        f"\n{following}" if following else ""
    )


def prepare() -> None:
    """Give the changelog the version's section, and commit it; where that is done already, nothing.

    Raises:
        NotReadyError: The checkout is not clean, git does not know who commits, versions differ, this one is released, or the
            changelog is not ready for it.
    """
    if changed := git("status", "--porcelain"):
        raise NotReadyError(f"commit or remove first:\n{changed.rstrip()}")
    git(
        "var", "GIT_COMMITTER_IDENT"
    )  # who has none cannot commit, and would learn that with files half written
    name = version()
    if git("tag", "--list", f"v{name}"):
        raise NotReadyError(f"v{name} is released: write the next version into {', '.join(VERSIONED)}")
    text, day = CHANGELOG.read_text(encoding="utf-8"), dt.datetime.now(dt.timezone.utc).date().isoformat()
    if f"\n## [{name}] - " in text:
        if KIND.search(unreleased(text)[1]):
            raise NotReadyError(
                f"{CHANGELOG} has a section of {name}: move there what stands under 'Unreleased'"
            )
        return
    CHANGELOG.write_text(with_section(text, name, day), encoding="utf-8")
    cited = re.sub(r"^date-released: .*\n", "", CITATION.read_text(encoding="utf-8"), flags=re.MULTILINE)
    cited = re.sub(r"^(version: .*\n)", rf"\1date-released: {day}\n", cited, flags=re.MULTILINE)
    CITATION.write_text(cited, encoding="utf-8")
    git("commit", "--quiet", "--message", f"Release {name}", "--", str(CHANGELOG), str(CITATION))


def tag(folder: Path, pythons: "list[str]") -> None:
    """Tag the commit that a folder's files were made of.

    Args:
        folder: Has the source distribution and the wheels.
        pythons: For which there must be wheels, as 3.12.

    Raises:
        NotReadyError: A file is missing, or the checkout has changed.
    """
    name = version()
    wanted = [f"sar_compiler-{name}.tar.gz"]
    wanted += [f"sar_compiler-{name}-cp{python.replace('.', '')}-*manylinux*.whl" for python in pythons]
    if missing := [each for each in wanted if not [*folder.glob(each)]]:
        raise NotReadyError(f"{folder} lacks {', '.join(missing)}")
    if changed := git("status", "--porcelain"):
        raise NotReadyError(f"building has changed the checkout:\n{changed.rstrip()}")
    git("tag", "--annotate", f"v{name}", "--message", f"sar_compiler {name}")


def fill() -> None:
    """Replace each placeholder that has a value in all tracked files but the one that declares it."""
    declared = Path(PUBLICATION).read_text(encoding="utf-8")
    for placeholder, value in re.findall(r'^placeholder = "(.+)"\nvalue = "(.+)"$', declared, re.MULTILINE):
        for name in git("grep", "-lIFe", placeholder, "--", ".", f":!{PUBLICATION}").splitlines():
            text = Path(name).read_text(encoding="utf-8")
            Path(name).write_text(text.replace(placeholder, value), encoding="utf-8")


if __name__ == "__main__":
    try:
        if sys.argv[1] == "fill":
            fill()
        elif sys.argv[1] == "prepare":
            prepare()
        else:
            tag(Path(sys.argv[2]), sys.argv[3:])
    except NotReadyError as error:
        sys.exit(f"make: {error}")
