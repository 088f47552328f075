"""Tests that questions in the field's terms find the right page of the site among the first three results.

The site's search finds a section if each word of the question starts a word in the page's title, the section's heading or its text. Words in
titles have the highest weight. The tests apply the same rule to the source pages of the site.
"""

import re
import runpy

import pytest

SITE = runpy.run_path("docs/site/pages.py")
# Questions of readers, each with the pages of which one must be found.
QUESTIONS = {
    "what is a behaviour tree": ("concepts/behaviour-trees",),
    "what is a tick": ("concepts/behaviour-trees",),
    "running status": ("concepts/statuses", "concepts/behaviour-trees"),
    "halt a node": ("concepts/statuses",),
    "sequence with memory": ("concepts/statuses",),
    "blackboard": ("concepts/blackboard",),
    "input port": ("concepts/blackboard",),
    "model checking": ("concepts/proofs",),
    "counterexample": ("concepts/proofs",),
    "install without ros": ("start/install",),
    "docker": ("start/install",),
    "migrate from BehaviorTree.CPP": ("how-to/from-btcpp",),
    "py_trees blackboard client": ("how-to/from-py-trees",),
    "pre-commit hook": ("how-to/check-in-ci",),
    "github actions": ("how-to/check-in-ci",),
    "action client": ("how-to/write-a-leaf",),
    "custom decorator": ("how-to/controls-and-decorators",),
    "launch file arguments": ("how-to/run-on-a-robot",),
    "namespace remapping": ("how-to/run-a-mission", "examples/namespace_and_remapping/README"),
    "fault injection": ("how-to/run-a-mission",),
    "rosbag": ("how-to/other-tools",),
    "groot2": ("how-to/other-tools",),
    "vscode": ("how-to/editors",),
    "runtime monitoring": ("how-to/watch-a-run",),
    "emergency stop": ("operate/operators-manual",),
    "retry node": ("reference/nodes/decorators",),
    "what is a leaf": ("concepts/behaviour-trees",),
    "service client": ("how-to/write-a-leaf", "how-to/leaves-by-attributes", "reference/nodes/ros"),
    "nav2 recovery node": ("reference/nodes/nav2", "how-to/nav2-trees"),
    "rate controller": ("reference/nodes/nav2",),
    "exit status": ("reference/commands",),
    "glossary": ("glossary",),
    "unit test a tree": ("reference/scenarios",),
    "how to pause the robot": ("operate/operators-manual",),
    "load a tree in Python": ("how-to/use-from-python",),
    "ignore a warning": ("reference/configuration",),
    "visualise a tree": ("how-to/draw-a-tree",),
    "start a mission from another node": ("how-to/serve-missions",),
}
FOUND = 32
_HEADING = re.compile(r"^#{1,4} (.*)$", re.MULTILINE)


def words(text):
    return re.findall(r"[a-z0-9_]+", text.lower())


@pytest.fixture(scope="module")
def sections(tmp_path_factory):
    """Return the searchable sections of the site: page, words of the title, words of the heading, words of the text."""
    folder = tmp_path_factory.mktemp("site") / "pages"
    SITE["write_pages"](folder)
    found = []
    for path in sorted(folder.rglob("*.md")):
        text = path.read_text(encoding="utf-8")
        if "exclude: true" in text[:60]:
            continue
        _, title, *rest = _HEADING.split(text)
        page = path.relative_to(folder).as_posix().removesuffix(".md")
        for heading, body in zip([title, *rest[1::2]], rest[::2], strict=True):
            found.append((page, {*words(title)}, {*words(heading)}, words(body)))
    return found


def weight(word, title, heading, text):
    """Return how well a section matches a word; 0 if it does not contain the word."""
    begins = [each for each in text if each.startswith(word)]
    named = 8 * any(each.startswith(word) for each in title) + 4 * any(
        each.startswith(word) for each in heading
    )
    return named + len(begins) / (len(begins) + 1 + len(text) / 100)


def pages_for(question, sections):
    """Return the pages for a question, the best one first."""
    best: dict[str, float] = {}
    for page, title, heading, text in sections:
        weights = [weight(word, title, heading, text) for word in words(question)]
        if all(weights):
            best[page] = max(best.get(page, 0), sum(weights))
    return sorted(best, key=best.__getitem__, reverse=True)


def test_questions_find_the_right_page_among_the_first_three(sections):
    missed = {
        question: pages_for(question, sections)[:3]
        for question, right in QUESTIONS.items()
        if not {*right} & {*pages_for(question, sections)[:3]}
    }
    assert len(QUESTIONS) - len(missed) >= FOUND, missed


def test_no_source_file_is_a_search_result(sections):
    assert [page for page, *_ in sections if re.search(r"\.(py|xml|yaml|toml|cff)$", page)] == []
    assert {f"{page}.md" for page, *_ in sections} >= SITE["TERMS"].keys()
