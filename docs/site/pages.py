"""Write the pages from which the site is built: `python docs/site/pages.py FOLDER`, see `make site`.

In the repository, a page links to sources, examples and pages in other folders by their paths. On the site, each linked file is
also a page, so that every link stays on the site. The README is the first page. Each public module has a page,
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
# On the site, pages with the whole docstrings replace this page.
_API = DOCS / "reference/api.md"
# Files whose paths differ only in case need other names, because many file systems do not distinguish case.
_PLACES = {
    ROOT / "README.md": "index.md",
    DOCS / "README.md": "pages.md",
    ROOT / "SECURITY.md": "vulnerabilities.md",
    _API: "api/trees.md",
}
# On the site's first page, links to the first file open the second file, which `docs/site/studio.py` replaces by the editor.
_EDITOR_LINK = (DOCS / "start/try-it.md", DOCS / "studio/index.html")
_LANGUAGES = {
    ".py": "python",
    ".xml": "xml",
    ".yaml": "yaml",
    ".yml": "yaml",
    ".cff": "yaml",
    ".toml": "toml",
}
_COPIED_SUFFIXES = {".html", ".pgm", ".png", ".svg"}
TERMS = {
    "concepts/behaviour-trees.md": "behavior tree, BT, tick, root, control flow, what is a leaf, what is a node",
    "concepts/statuses.md": "running status, SUCCESS, FAILURE, INVALID, halt a node, preempt, reactive, sequence with memory",
    "concepts/blackboard.md": "blackboard entry, key, input port, output port, remap, shared variable",
    "concepts/facts.md": "world model, test case, mock, stub",
    "concepts/failures-and-recovery.md": "fault tolerance, watchdog, heartbeat, robustness",
    "concepts/security.md": "sandbox, untrusted files, attack, functional safety",
    "concepts/proofs.md": "model checking, formal verification, counterexample, state space, liveness, deadlock, LTL",
    "start/install.md": "setup, pip, colcon, apt, docker, container, requirements, dependencies",
    "how-to/from-btcpp.md": "migrate, port, convert, import from BehaviorTree.CPP, Groot",
    "how-to/from-py-trees.md": "migrate from py_trees, py_trees_ros, behaviour class",
    "how-to/check-in-ci.md": "continuous integration, lint, pre-commit hook, GitHub Actions, GitLab, SARIF",
    "how-to/write-a-leaf.md": "action client, service client, subscriber, custom node, custom leaf, StatefulActionNode, plugin",
    "how-to/leaves-by-attributes.md": "service client, action client, publisher, subscriber, tf listener, without code",
    "how-to/use-from-python.md": "Python API, load a tree in Python, script, notebook, Jupyter, library",
    "how-to/draw-a-tree.md": "visualise a tree, Graphviz, dot, SVG, PNG, Mermaid",
    "how-to/serve-missions.md": "action server, ExecuteTree, start a mission from another node",
    "how-to/controls-and-decorators.md": "custom decorator, custom control node",
    "how-to/run-a-mission.md": "fault injection, namespace remapping, remap, ROS arguments, simulate a failure",
    "how-to/run-on-a-robot.md": "launch file arguments, bringup, real robot, deployment",
    "how-to/other-tools.md": "Groot2, Foxglove, RViz, rosbag, record, visualise, monitor",
    "how-to/editors.md": "VSCode, VS Code, language server, LSP, autocompletion",
    "how-to/watch-a-run.md": "runtime monitoring, runtime verification, monitor, alarm",
    "how-to/compare-runs.md": "trace checking, conformance, log analysis",
    "how-to/success-probability.md": "reliability, Markov chain, probabilistic model checking, risk",
    "how-to/monte-carlo.md": "random runs, simulation campaign, statistics",
    "operate/first-mission.md": "train operators, exercise, practise, rehearse, low battery, connection lost",
    "operate/operators-manual.md": "emergency stop, how to pause the robot, return to base, abort, dashboard",
    "operate/troubleshooting.md": "error message, not working, fails to start, fix",
    "glossary.md": "terms, terminology, vocabulary, definitions, meaning of a word",
    "reference/journal.md": "log, resume after a crash, restart, persistence, checkpoint",
    "reference/scenarios.md": "unit test a tree, test case, expected result, mock a leaf, coverage of tests",
    "reference/commands.md": "command line options, CLI, exit status, exit code, return code",
    "reference/configuration.md": "settings, ignore a warning, disable a finding, sar.toml",
    "reference/parameters.md": "ROS parameter file, YAML parameters, waypoints, zones, configuration of the mission",
    "reference/nodes/decorators.md": "retry node, repeat node, timeout node, inverter node, wait",
    "reference/nodes/ros.md": "service client, action client, subscriber, publisher, tf, call a service from a tree",
    "reference/nodes/nav2.md": "recovery node, pipeline sequence, rate controller",
    "reference/nodes/controls.md": "selector node, fallback node, sequence node, parallel node, switch node",
}
"""Further words by which readers may search for a page."""
_EXCLUDED_FROM_SEARCH = "---\nsearch:\n  exclude: true\n---\n\n"
"""The head of a page that the search must not find, such as a source file."""
_FENCE = re.compile(r"^\s*```")
_CODE = re.compile(r"(?<!`)(`+)(?!`).+?(?<!`)\1(?!`)")
_LINK = re.compile(r'(\]\(|\bsrc=")(?!https?:|mailto:|#)([^)"\s#]+)((?:#[^)\s]*)?[)"])')
_PUBLIC = re.compile(r"^    from (\S+) import (\w+) as \2$", re.MULTILINE)


def write_pages(folder: Path) -> None:
    """Write all pages into a new folder."""
    shutil.rmtree(folder, ignore_errors=True)
    to_come, seen = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))], {_API}
    while to_come:
        path = to_come.pop()
        if path not in seen:
            seen.add(path)
            to_come.extend(_write(path, folder))
    shutil.copy(Path(__file__).with_name("search_on_use.js"), folder)
    for group, title in GROUPS.items():
        _save(folder / f"api/{title.lower()}.md", _api_page(group, title).encode())


def place(path: Path) -> str:
    """Return the path on the site of a file of the repository, or of its page."""
    if path in _PLACES:
        return _PLACES[path]
    source = path.relative_to(DOCS if path.is_relative_to(DOCS) else ROOT).as_posix()
    return source if path.suffix in {".md", *_COPIED_SUFFIXES} else f"{source}.md"


def _write(path: Path, folder: Path) -> Iterator[Path]:
    """Write a file, or its page, and yield the files to which it links."""
    data = path.read_bytes()
    if path.suffix == ".md":
        lines, is_code = data.decode().splitlines(keepends=True), False
        for number, line in enumerate(lines):
            is_code ^= bool(_FENCE.match(line))
            if not is_code:
                lines[number] = _with_links(line, path)
                yield from (_link_target(path, found[2]) for found in _links(line))
        place_there = place(path)
        if place_there in TERMS:
            lines.append(f"\n*Related terms: {TERMS[place_there]}.*\n")
        if path.name == "CHANGELOG.md":
            lines.insert(0, _EXCLUDED_FROM_SEARCH)
        data = "".join(lines).encode()
    elif path.suffix not in _COPIED_SUFFIXES:
        name = path.relative_to(ROOT).as_posix()
        code = f"````{_LANGUAGES.get(path.suffix, '')}\n{data.decode()}\n````\n"
        data = f"{_EXCLUDED_FROM_SEARCH}# {name}\n\n{code}".encode()
    _save(folder / place(path), data)


def _links(line: str) -> "Iterator[re.Match[str]]":
    """Return the links to files in a line, except for links in code."""
    return _LINK.finditer(_CODE.sub(lambda code: " " * len(code[0]), line))


def _link_target(path: Path, target: str) -> Path:
    goal = (path.parent / target).resolve()
    return goal / "README.md" if goal.is_dir() else goal


def _with_links(line: str, path: Path) -> str:
    """Return a line of a page, in which each link names the target's path on the site."""
    for found in reversed([*_links(line)]):
        goal = _link_target(path, found[2])
        goal = _EDITOR_LINK[1] if (path, goal) == (ROOT / "README.md", _EDITOR_LINK[0]) else goal
        target = os.path.relpath(place(goal), Path(place(path)).parent)
        line = f"{line[: found.start(2)]}{target}{line[found.end(2) :]}"
    return line


def _api_page(group: str, title: str) -> str:
    """Return the page of a public module, which mkdocstrings fills."""
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
