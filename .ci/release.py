"""Steps of `make release`: before the build, it adds and commits the section in the changelog; after the build, it sets the tag.

`python .ci/release.py fill` replaces the placeholders of `release/publication.toml` in all files.
"""

import datetime as dt
import re
import subprocess
import sys
from pathlib import Path

CHANGELOG, CITATION, PUBLICATION = Path("CHANGELOG.md"), Path("CITATION.cff"), "release/publication.toml"
# The files that contain the version, each with a pattern.
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
    """Raised if the release cannot be built yet."""


def git(*arguments: str) -> str:
    """Run git, and return its output.

    Raises:
        NotReadyError: If git fails.
    """
    run = subprocess.run(("git", *arguments), capture_output=True, text=True, check=False)  # noqa: S603, S607 - ours
    if run.returncode:
        raise NotReadyError(f"git {arguments[0]}: {run.stderr.strip()}")
    return run.stdout


def version() -> str:
    """Return the version of the project.

    Raises:
        NotReadyError: If the files contain different versions.
    """
    versions = {
        name: re.findall(pattern, Path(name).read_text(encoding="utf-8"), re.MULTILINE)
        for name, pattern in VERSIONED.items()
    }
    if len({*map(tuple, versions.values())}) != 1:
        raise NotReadyError(
            "the versions differ: " + ", ".join(f"{name} has {has}" for name, has in versions.items())
        )
    [found] = versions["pyproject.toml"]
    return found


def unreleased(changelog: str) -> "tuple[str, str, str]":
    """Split a changelog: the text up to the heading of unreleased changes, these changes, and the rest."""
    head, _, rest = changelog.partition(UNRELEASED)
    section, following = re.fullmatch(r"(.*?)(^## .*|\Z)", rest, re.DOTALL | re.MULTILINE).groups()  # type: ignore[union-attr]
    return head, section, following


def with_section(changelog: str, name: str, day: str) -> str:
    """Return the changelog with the unreleased changes in the section of a version. Omit the text before their first heading.

    Args:
        changelog: The text of the changelog.
        name: The version.
        day: The day of the release, as YYYY-MM-DD.

    Raises:
        NotReadyError: If there are no unreleased changes.
    """
    head, section, following = unreleased(changelog)
    kinds = KIND.search(section)
    if kinds is None:
        raise NotReadyError(f"{CHANGELOG} has nothing under 'Unreleased'")
    return f"{head}{UNRELEASED}\n## [{name}] - {day}\n\n{kinds[0].rstrip()}\n" + (
        f"\n{following}" if following else ""
    )


def prepare() -> None:
    """Add the version's section to the changelog and commit it. Do nothing if the section exists.

    Raises:
        NotReadyError: If the checkout is not clean, git has no committer identity, the versions differ, the version was released
            before, or the changelog is not ready.
    """
    if changed := git("status", "--porcelain"):
        raise NotReadyError(f"commit or remove first:\n{changed.rstrip()}")
    # Without a committer identity, the commit would fail after the files are written.
    git("var", "GIT_COMMITTER_IDENT")
    name = version()
    if git("tag", "--list", f"v{name}"):
        raise NotReadyError(
            f"v{name} was released already. Write the next version into {', '.join(VERSIONED)}"
        )
    text, day = CHANGELOG.read_text(encoding="utf-8"), dt.datetime.now(dt.timezone.utc).date().isoformat()
    if f"\n## [{name}] - " in text:
        if KIND.search(unreleased(text)[1]):
            raise NotReadyError(
                f"{CHANGELOG} has a section for {name}. Move the entries under 'Unreleased' to this section"
            )
        return
    CHANGELOG.write_text(with_section(text, name, day), encoding="utf-8")
    cited = re.sub(r"^date-released: .*\n", "", CITATION.read_text(encoding="utf-8"), flags=re.MULTILINE)
    cited = re.sub(r"^(version: .*\n)", rf"\1date-released: {day}\n", cited, flags=re.MULTILINE)
    CITATION.write_text(cited, encoding="utf-8")
    git("commit", "--quiet", "--message", f"Release {name}", "--", str(CHANGELOG), str(CITATION))


def tag(folder: Path, pythons: "list[str]") -> None:
    """Tag the commit from which the files in a folder were built.

    Args:
        folder: The folder of the source distribution and the wheels.
        pythons: The Python versions that need wheels, such as 3.12.

    Raises:
        NotReadyError: If a file is missing, or the checkout has changed.
    """
    name = version()
    wanted = [f"sar_compiler-{name}.tar.gz"]
    wanted += [f"sar_compiler-{name}-cp{python.replace('.', '')}-*manylinux*.whl" for python in pythons]
    if missing := [each for each in wanted if not [*folder.glob(each)]]:
        raise NotReadyError(f"{folder} lacks {', '.join(missing)}")
    if changed := git("status", "--porcelain"):
        raise NotReadyError(f"the build has changed files of the checkout:\n{changed.rstrip()}")
    git("tag", "--annotate", f"v{name}", "--message", f"sar_compiler {name}")


def fill() -> None:
    """Replace each placeholder that has a value, in all tracked files except the file that declares it."""
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
