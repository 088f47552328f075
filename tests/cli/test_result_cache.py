"""Tests of the results that `validate` stores in the user's cache folder, and of the workers that check many files."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from sar_compiler.validation import validation
from sar_compiler.validation.forked_workers import ForkedWorkers
from tests.trees import document

# Prints on standard error which files were checked, and in which process.
_PROGRAM = """
import os, sys
from sar_compiler.validation.validation import FileChecker

check, parent = FileChecker.check, os.getpid()

def counted(self, path):
    where = "here" if os.getpid() == parent else "copy"
    os.write(2, f"checked {path} {where}\\n".encode())
    return check(self, path)

FileChecker.check = counted
from sar_compiler.cli.compile import main
sys.exit(main(sys.argv[1:]))
"""
CORRECT = document("<AlwaysSuccess/>")
WRONG = document('<AlwaysSuccess nme="x"/>')
SCRIPT = document('<Sequence><Script code="a := 1"/><ScriptCondition code="a == \'x\'"/></Sequence>')


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    (tmp_path / "work" / "trees").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "work")
    # Results depend on the folders that exist, so this one must exist before the first result.
    (tmp_path / ".cache").mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / ".cache"))
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")


def write(name, text):
    Path(name).parent.mkdir(parents=True, exist_ok=True)
    Path(name).write_text(text, encoding="utf-8")


class CompletedValidation:
    """A completed run of `validate`."""

    def __init__(self, *arguments, **environment):
        command = [sys.executable, "-c", _PROGRAM, "validate", *map(str, arguments)]
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            check=False,
            timeout=120.0,
            env={**os.environ, **environment},
        )
        lines = done.stderr.splitlines(keepends=True)
        self.result = (
            done.returncode,
            done.stdout,
            "".join(each for each in lines if not each.startswith("checked ")),
        )
        self.checked = sorted(each.split()[1] for each in lines if each.startswith("checked "))
        self.processes = {each.split()[2] for each in lines if each.startswith("checked ")}


def stored_results():
    return [*Path(os.environ["XDG_CACHE_HOME"], "sar_compiler").glob("*.json")]


def test_unchanged_file_is_not_checked_again_and_has_same_output():
    write("trees/a.xml", WRONG)
    write("trees/b.xml", SCRIPT)
    for form in ("text", "json", "sarif", "github"):
        first, again = (CompletedValidation("trees", "--format", form) for _ in range(2))
        fresh = CompletedValidation("trees", "--format", form, "--no-cache")
        assert again.checked == []
        assert first.result == again.result == fresh.result
        assert len(fresh.checked) == 2


def test_no_cache_option_stores_no_results():
    write("a.xml", CORRECT)
    CompletedValidation("a.xml", "--no-cache")
    assert stored_results() == []


def test_results_are_stored_as_json_after_checksum():
    write("a.xml", WRONG)
    CompletedValidation("a.xml")
    (path,) = stored_results()
    assert (
        json.loads(path.read_bytes().partition(b"\n")[2])["checks"]["a.xml"]["findings"][0][0]
        == "unknown-attribute"
    )
    assert path.parent.stat().st_mode & 0o077 == 0


INCLUDING = (
    document('<SubTree ID="B"/>')
    .replace("<Beh", '<include path="b.xml"/><Beh')
    .replace("<root", '<root main_tree_to_execute="Main"')
)
UNREAD = document('<SetBlackboard value="4" output_key="k"/>')
PALETTE = '<root BTCPP_format="4"><TreeNodesModel><Action ID="Lift"/></TreeNodesModel></root>'
LEAVES = "from sar_compiler.leaves import Kind, register\nfrom py_trees.behaviours import Success\n\n\n@register('{}', kind=Kind.ACTION)\nclass Leaf(Success):\n    '''A leaf.'''\n"

# Each: the initial files, the changed files (None: deleted), and the arguments.
CHANGES: dict[str, tuple[dict[str, str], dict[str, str | None], list[str]]] = {
    "the file": ({"a.xml": CORRECT}, {"a.xml": WRONG}, ["a.xml"]),
    "the file, of the same size": ({"a.xml": WRONG}, {"a.xml": WRONG.replace("nme", "xme")}, ["a.xml"]),
    "an include": (
        {"a.xml": INCLUDING, "b.xml": document("<AlwaysSuccess/>", "B")},
        {"b.xml": document('<AlwaysSuccess nme="x"/>', "B")},
        ["a.xml"],
    ),
    "an include that was missing": (
        {"a.xml": INCLUDING},
        {"b.xml": document("<AlwaysSuccess/>", "B")},
        ["a.xml"],
    ),
    "a palette": (
        {"a.xml": document("<Lift/>"), "p.xml": PALETTE},
        {"p.xml": PALETTE.replace("Lift", "Drop")},
        ["a.xml", "--model", "p.xml"],
    ),
    "a palette that appears": ({".git/x": "", "a.xml": document("<Lift/>")}, {"p.xml": PALETTE}, ["a.xml"]),
    "a palette that appears in a folder above": (
        {"../.git/x": "", "a.xml": document("<Lift/>")},
        {"../p.xml": PALETTE},
        ["a.xml"],
    ),
    "a palette that goes": (
        {".git/x": "", "a.xml": document("<Lift/>"), "p.xml": PALETTE},
        {"p.xml": None},
        ["a.xml"],
    ),
    "settings that appear": (
        {"a.xml": UNREAD},
        {"sar.toml": '[findings]\nunread-key = "error"\n'},
        ["a.xml"],
    ),
    "settings that appear in a folder above": ({"a.xml": WRONG}, {"../sar.toml": "x ="}, ["a.xml"]),
    "settings": (
        {
            "a.xml": UNREAD,
            "sar.toml": '[findings]\nunread-key = "off"\n',
        },
        {"sar.toml": '[findings]\nunread-key = "error"\n'},
        ["a.xml"],
    ),
    "a repository that appears": (
        {"a.xml": document('<SubTree ID="B"/>'), "../b.xml": document("<AlwaysSuccess/>", "B")},
        {"../.git/x": ""},
        ["a.xml"],
    ),
    "a tree of a set": (
        {"t/a.xml": document('<SubTree ID="B"/>'), "t/b.xml": document("<AlwaysSuccess/>", "B")},
        {"t/b.xml": document("<AlwaysSuccess/>", "C")},
        ["t"],
    ),
    "another file of those that are named": (
        {"t/a.xml": document("<AlwaysSuccess/>", "A")},
        {"t/b.xml": document('<SubTree ID="A"/>', "B")},
        ["t"],
    ),
    "a module of leaves": (
        {"a.xml": document("<Lift/>"), "leaves.py": LEAVES.format("Lift")},
        {"leaves.py": LEAVES.format("Drop")},
        ["a.xml", "--nodes", "leaves"],
    ),
    "a module that leaves import": (
        {
            "a.xml": document("<Lift/>"),
            "words.py": "TAG = 'Lift'\n",
            "leaves.py": LEAVES.replace("'{}'", "TAG").replace("\n\n\n@", "\nfrom words import TAG\n\n\n@"),
        },
        {"words.py": "TAG = 'Drop'\n"},
        ["a.xml", "--nodes", "leaves"],
    ),
}


@pytest.mark.parametrize("what", CHANGES)
def test_change_invalidates_stored_result(what):
    before, changes, arguments = CHANGES[what]
    for name, text in before.items():
        write(name, text)
    # Results of a module that has just been written are not stored, because an older version may have been imported.
    for name in before:
        os.utime(name, (1_000_000_000, 1_000_000_000))
    first = CompletedValidation(*arguments)
    assert CompletedValidation(*arguments).checked == [], "no result was stored"
    for name, changed in changes.items():
        if changed is None:
            Path(name).unlink()
        else:
            write(name, changed)
    then = CompletedValidation(*arguments)
    assert then.result == CompletedValidation(*arguments, "--no-cache").result
    assert then.checked
    assert then.result != first.result


def test_results_depend_on_options_and_folder():
    write("trees/a.xml", document("<Lift/>"))
    write("p.xml", PALETTE)
    write("t/p.xml", PALETTE)
    assert CompletedValidation("trees/a.xml", "--isolated").result[0] == 1
    assert CompletedValidation("trees/a.xml", "--isolated", "--model", "p.xml").result[0] == 0
    os.chdir("trees")
    assert CompletedValidation("a.xml", "--isolated").result[0] == 1


@pytest.mark.parametrize("damage", [b"", b"x", b"0" * 64 + b"\n{}", None])
def test_damaged_results_are_ignored_and_replaced(damage):
    write("a.xml", WRONG)
    first = CompletedValidation("a.xml")
    (path,) = stored_results()
    path.write_bytes(
        path.read_bytes().replace(b"unknown-attribute", b"unknown-element!!") if damage is None else damage
    )
    again = CompletedValidation("a.xml")
    assert (again.result, again.checked) == (first.result, ["a.xml"])
    assert CompletedValidation("a.xml").checked == []


def test_files_are_checked_if_results_cannot_be_stored():
    write("a.xml", WRONG)
    write("no_folder", "")
    assert (
        CompletedValidation("a.xml", XDG_CACHE_HOME=str(Path("no_folder").resolve())).result
        == CompletedValidation("a.xml", "--no-cache").result
    )


def test_oldest_results_are_deleted_above_limit():
    write("a.xml", CORRECT)
    CompletedValidation("a.xml")
    (first,) = stored_results()
    for number in range(60):
        (first.parent / f"{number}.json").write_bytes(b"x")
        os.utime(first.parent / f"{number}.json", (number, number))
    write("a.xml", WRONG)
    CompletedValidation("a.xml")
    left = {path.stem for path in stored_results()}
    assert len(left) == 40
    assert {first.stem, "59"} <= left
    assert "0" not in left


def test_concurrent_processes_store_complete_results():
    for number in range(6):
        write(f"trees/{number}.xml", WRONG)
    command = [sys.executable, "-c", _PROGRAM, "validate", "trees", "--format", "json"]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) for _ in range(3)]
    assert len({each.communicate(timeout=120.0)[0] for each in running}) == 1
    assert CompletedValidation("trees").checked == []


def test_result_that_depends_on_work_limit_is_not_stored():
    loop = '<Script code="a := 0"/><KeepRunningUntilFailure><Sequence><Sleep msec="1"/><Script code="a += 1"/></Sequence></KeepRunningUntilFailure>'
    write("a.xml", document(f"<Sequence>{loop}</Sequence>"))
    CompletedValidation("a.xml", "--deep", "0.01")
    assert CompletedValidation("a.xml", "--deep", "0.01").checked == ["a.xml"]


def write_many(count):
    for number in range(count):
        write(f"trees/{number:02}.xml", (CORRECT, WRONG, SCRIPT)[number % 3].replace("Main", f"T{number}"))


def test_only_many_files_are_checked_by_workers():
    write_many(validation.FEWEST_FOR_WORKERS)
    whole = CompletedValidation("trees", "--no-cache")
    assert whole.processes == ({"copy"} if len(os.sched_getaffinity(0)) > 1 else {"here"})
    few = CompletedValidation(*sorted(Path("trees").iterdir())[1:], "--no-cache")
    assert few.processes == {"here"}
    lines = [each for each in whole.result[1].splitlines() if each.startswith("trees/")]
    assert lines == sorted(lines)


@pytest.mark.parametrize("form", ["text", "json"])
def test_workers_report_same_findings_as_one_process(form):
    write_many(24)
    command = [
        sys.executable,
        "-c",
        "import os; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\n" + _PROGRAM,
    ]
    alone = subprocess.run(
        [*command, "validate", "trees", "--no-cache", "--all", "--format", form],
        capture_output=True,
        text=True,
        check=False,
    )
    assert " here" in alone.stderr
    assert alone.stdout == CompletedValidation("trees", "--no-cache", "--all", "--format", form).result[1]


def test_ctrl_c_ends_workers():
    write_many(40)
    loop = (
        "".join(f'<Script code="k{n} := 0"/>' for n in range(8))
        + "<ParallelAll>"
        + "".join(
            f'<Repeat num_cycles="9"><Sequence><Sleep msec="1"/><Script code="k{n} += 1"/></Sequence></Repeat>'
            for n in range(8)
        )
        + "</ParallelAll>"
    )
    for number in range(40):
        write(f"trees/{number:02}.xml", document(f"<Sequence>{loop}</Sequence>", f"T{number}"))
    with subprocess.Popen(
        [sys.executable, "-c", _PROGRAM, "validate", "trees", "--no-cache"],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
    ) as process:
        assert process.stderr is not None
        assert b"checked" in process.stderr.readline()
        os.killpg(process.pid, signal.SIGINT)
        _, said = process.communicate(timeout=120.0)
        assert process.returncode == 130, said
        assert b"Traceback" not in said
        assert b"stopped by Ctrl-C" in said
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs os.fork")
def test_ctrl_c_between_worker_starts_is_reported():
    write_many(40)
    program = """
import os, signal, sys
fork = os.fork

def fork_and_interrupt():
    copy = fork()
    if copy:
        os.kill(os.getpid(), signal.SIGINT)
    return copy

os.fork = fork_and_interrupt
from sar_compiler.cli.compile import main
status = main(sys.argv[1:])
try:
    os.waitpid(-1, 0)
except ChildProcessError:
    sys.exit(status)
"""
    command = [sys.executable, "-c", program, "validate", "trees", "--no-cache"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120.0)
    assert (done.returncode, done.stderr.count("stopped by Ctrl-C (40 files not checked)")) == (130, 1)
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs os.fork")
def test_items_of_killed_worker_are_left_to_main_process():
    def work(number):
        if number == 3:
            os.kill(os.getpid(), signal.SIGKILL)
        return str(number)

    workers = ForkedWorkers(work, range(10), 60.0)
    try:
        workers.start(2)
        found = dict(workers.results(lambda: False))
    finally:
        workers.terminate_workers()
    assert found.keys() == {*range(10)}
    assert found[3] is None
    assert {each for number, each in found.items() if each is not None and each != str(number)} == set()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs os.fork")
def test_all_items_are_left_to_main_process_if_every_worker_is_killed():
    workers = ForkedWorkers(lambda _: os.kill(os.getpid(), signal.SIGKILL), range(10), 60.0)
    try:
        workers.start(2)
        assert dict(workers.results(lambda: False)) == dict.fromkeys(range(10))
    finally:
        workers.terminate_workers()


def test_each_file_is_compiled_once_for_proofs(tmp_path):
    write("a.xml", SCRIPT)
    program = """
import sys
from sar_compiler.analysis import proofs

compile_simulated, count = proofs.compile_simulated, []

def counted(*arguments, **options):
    count.append(1)
    return compile_simulated(*arguments, **options)

proofs.compile_simulated = counted
from sar_compiler.cli.compile import main
main(["validate", "--no-cache", "a.xml"])
print(len(count), file=sys.stderr)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stderr.splitlines()[-1] == "1"
