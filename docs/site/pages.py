"""The pages that the site is built from: `python docs/site/pages.py FOLDER`, see `make site`.

In the repository a page links to sources, examples and other folders' pages by their places. On the site each of these is
a page as well, so that no link leads out of it. The README is the first page, and each public group of names has one,
which mkdocstrings fills from the docstrings.
"""

import importlib
import inspect
import os
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
GROUPS = {
    "sar_compiler": "Trees",
    "sar_compiler.execution": "Runs",
    "sar_compiler.leaves": "Leaves",
    "sar_compiler.missions": "Missions",
    "sar_compiler.testing": "Tests",
}
# Of two that differ only in capitals, many file systems know one.
_PLACES = {
    ROOT / "README.md": "index.md",
    DOCS / "README.md": "pages.md",
    ROOT / "SECURITY.md": "vulnerabilities.md",
}
_LANGUAGES = {
    ".py": "python",
    ".xml": "xml",
    ".yaml": "yaml",
    ".yml": "yaml",
    ".cff": "yaml",
    ".toml": "toml",
}
_AS_THEY_ARE = {".html", ".pgm", ".png", ".svg"}
_FENCE = re.compile(r"^\s*```")
_CODE = re.compile(r"(?<!`)(`+)(?!`).+?(?<!`)\1(?!`)")
_LINK = re.compile(r"(\]\()(?!https?:|mailto:|#)([^)\s#]+)((?:#[^)\s]*)?\))")
_PUBLIC = re.compile(r"^    from (\S+) import (\w+) as \2$", re.MULTILINE)


def write_pages(folder: Path) -> None:
    """Write all pages into a new folder."""
    shutil.rmtree(folder, ignore_errors=True)
    to_come, seen = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))], set[Path]()
    while to_come:
        path = to_come.pop()
        if path not in seen:
            seen.add(path)
            to_come.extend(_write(path, folder))
    for group, title in GROUPS.items():
        _save(folder / f"api/{title.lower()}.md", _names_of(group, title).encode())


def place(path: Path) -> str:
    """Return where a file of the repository, or its page, is on the site."""
    if path in _PLACES:
        return _PLACES[path]
    source = path.relative_to(DOCS if path.is_relative_to(DOCS) else ROOT).as_posix()
    return source if path.suffix in {".md", *_AS_THEY_ARE} else f"{source}.md"


def _write(path: Path, folder: Path) -> Iterator[Path]:
    """Write one file, or its page; yield the files that it links to."""
    data = path.read_bytes()
    if path.suffix == ".md":
        lines, is_code = data.decode().splitlines(keepends=True), False
        for number, line in enumerate(lines):
            is_code ^= bool(_FENCE.match(line))
            if not is_code:
                lines[number] = _with_links(line, path)
                yield from (_goal(path, found[2]) for found in _links(line))
        data = "".join(lines).encode()
    elif path.suffix not in _AS_THEY_ARE:
        name = path.relative_to(ROOT).as_posix()
        data = f"# {name}\n\n````{_LANGUAGES.get(path.suffix, '')}\n{data.decode()}\n````\n".encode()
    _save(folder / place(path), data)


def _links(line: str) -> "Iterator[re.Match[str]]":
    """Return the links of a line to files, without what is only shown as code."""
    return _LINK.finditer(_CODE.sub(lambda code: " " * len(code[0]), line))


def _goal(path: Path, target: str) -> Path:
    goal = (path.parent / target).resolve()
    return goal / "README.md" if goal.is_dir() else goal


def _with_links(line: str, path: Path) -> str:
    """Return a line of a page with each of its links leading to where its goal is on the site."""
    for found in reversed([*_links(line)]):
        target = os.path.relpath(place(_goal(path, found[2])), Path(place(path)).parent)
        line = f"{line[: found.start(2)]}{target}{line[found.end(2) :]}"
    return line


def _names_of(group: str, title: str) -> str:
    """Return the page of a public group of names, to be filled by mkdocstrings."""
    module = importlib.import_module(group)
    homes = {name: home for home, name in _PUBLIC.findall(inspect.getsource(module))}
    texts = [
        f"::: {homes.get(name, group)}.{name}\n    options:\n      heading: {group}.{name}\n      toc_label: {name}\n"
        for name in sorted(module.__all__, key=str.lower)
    ]
    return "\n".join([f"# {title}: `{group}`\n", *texts])


def _save(path: Path, data: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)


if __name__ == "__main__":
    write_pages(Path(sys.argv[1]))
