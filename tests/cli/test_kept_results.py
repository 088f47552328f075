"""`validate` keeps results in the user's cache folder, and checks many files in copies of its process."""

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

# Says on standard error how many files were checked, and where.
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
    # What is there before counts as a surrounding, and must not come with the first result.
    (tmp_path / ".cache").mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / ".cache"))
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")


def write(name, text):
    Path(name).parent.mkdir(parents=True, exist_ok=True)
    Path(name).write_text(text, encoding="utf-8")


class Done:
    """A `validate` that has ended."""

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
        self.said = (
            done.returncode,
            done.stdout,
            "".join(each for each in lines if not each.startswith("checked ")),
        )
        self.checked = sorted(each.split()[1] for each in lines if each.startswith("checked "))
        self.places = {each.split()[2] for each in lines if each.startswith("checked ")}


def kept():
    return [*Path(os.environ["XDG_CACHE_HOME"], "sar_compiler").glob("*.json")]


def test_a_file_that_is_as_it_was_is_not_checked_again_and_the_same_is_said():
    write("trees/a.xml", WRONG)
    write("trees/b.xml", SCRIPT)
    for form in ("text", "json", "sarif", "github"):
        first, again = (Done("trees", "--format", form) for _ in range(2))
        fresh = Done("trees", "--format", form, "--no-cache")
        assert again.checked == []
        assert first.said == again.said == fresh.said
        assert len(fresh.checked) == 2


def test_without_a_cache_nothing_is_kept():
    write("a.xml", CORRECT)
    Done("a.xml", "--no-cache")
    assert kept() == []


def test_what_is_kept_is_json_behind_a_checksum():
    write("a.xml", WRONG)
    Done("a.xml")
    (path,) = kept()
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

# What is there at first, the changes to it, and the arguments.
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
def test_nothing_is_stale(what):
    before, changes, arguments = CHANGES[what]
    for name, text in before.items():
        write(name, text)
    # A module that was written a moment ago may be imported as it was before: nothing is kept of that.
    for name in before:
        os.utime(name, (1_000_000_000, 1_000_000_000))
    first = Done(*arguments)
    assert Done(*arguments).checked == [], "nothing was kept"
    for name, changed in changes.items():
        if changed is None:
            Path(name).unlink()
        else:
            write(name, changed)
    then = Done(*arguments)
    assert then.said == Done(*arguments, "--no-cache").said
    assert then.checked
    assert then.said != first.said


def test_results_of_other_options_and_folders_are_others():
    write("trees/a.xml", document("<Lift/>"))
    write("p.xml", PALETTE)
    write("t/p.xml", PALETTE)
    assert Done("trees/a.xml", "--isolated").said[0] == 1
    assert Done("trees/a.xml", "--isolated", "--model", "p.xml").said[0] == 0
    os.chdir("trees")
    assert Done("a.xml", "--isolated").said[0] == 1


@pytest.mark.parametrize("damage", [b"", b"x", b"0" * 64 + b"\n{}", None])
def test_what_is_damaged_is_as_good_as_none(damage):
    write("a.xml", WRONG)
    first = Done("a.xml")
    (path,) = kept()
    path.write_bytes(
        path.read_bytes().replace(b"unknown-attribute", b"unknown-element!!") if damage is None else damage
    )
    again = Done("a.xml")
    assert (again.said, again.checked) == (first.said, ["a.xml"])
    assert Done("a.xml").checked == []


def test_where_nothing_can_be_kept_files_are_checked_all_the_same():
    write("a.xml", WRONG)
    write("no_folder", "")
    assert (
        Done("a.xml", XDG_CACHE_HOME=str(Path("no_folder").resolve())).said
        == Done("a.xml", "--no-cache").said
    )


def test_the_oldest_results_go_where_many_are_kept():
    write("a.xml", CORRECT)
    Done("a.xml")
    (first,) = kept()
    for number in range(60):
        (first.parent / f"{number}.json").write_bytes(b"x")
        os.utime(first.parent / f"{number}.json", (number, number))
    write("a.xml", WRONG)
    Done("a.xml")
    left = {path.stem for path in kept()}
    assert len(left) == 40
    assert {first.stem, "59"} <= left
    assert "0" not in left


def test_two_processes_at_once_keep_whole_files():
    for number in range(6):
        write(f"trees/{number}.xml", WRONG)
    command = [sys.executable, "-c", _PROGRAM, "validate", "trees", "--format", "json"]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) for _ in range(3)]
    assert len({each.communicate(timeout=120.0)[0] for each in running}) == 1
    assert Done("trees").checked == []


def test_a_result_that_a_limit_of_work_has_decided_is_not_kept():
    loop = '<Script code="a := 0"/><KeepRunningUntilFailure><Sequence><Sleep msec="1"/><Script code="a += 1"/></Sequence></KeepRunningUntilFailure>'
    write("a.xml", document(f"<Sequence>{loop}</Sequence>"))
    Done("a.xml", "--deep", "0.01")
    assert Done("a.xml", "--deep", "0.01").checked == ["a.xml"]


def many(count):
    for number in range(count):
        write(f"trees/{number:02}.xml", (CORRECT, WRONG, SCRIPT)[number % 3].replace("Main", f"T{number}"))


def test_many_files_are_checked_in_copies_of_the_process_and_few_are_not():
    many(validation.FEWEST_FOR_WORKERS)
    whole = Done("trees", "--no-cache")
    assert whole.places == ({"copy"} if len(os.sched_getaffinity(0)) > 1 else {"here"})
    few = Done(*sorted(Path("trees").iterdir())[1:], "--no-cache")
    assert few.places == {"here"}
    lines = [each for each in whole.said[1].splitlines() if each.startswith("trees/")]
    assert lines == sorted(lines)


@pytest.mark.parametrize("form", ["text", "json"])
def test_copies_say_what_one_process_says(form):
    many(24)
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
    assert alone.stdout == Done("trees", "--no-cache", "--all", "--format", form).said[1]


def test_ctrl_c_ends_the_copies_too():
    many(40)
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


@pytest.mark.skipif(not hasattr(os, "fork"), reason="copies of a process")
def test_ctrl_c_between_the_starts_of_two_copies_is_reported_as_later():
    many(40)
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


@pytest.mark.skipif(not hasattr(os, "fork"), reason="copies of a process")
def test_what_a_killed_copy_had_is_left_to_the_process():
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


@pytest.mark.skipif(not hasattr(os, "fork"), reason="copies of a process")
def test_all_is_left_to_the_process_where_every_copy_is_killed():
    workers = ForkedWorkers(lambda _: os.kill(os.getpid(), signal.SIGKILL), range(10), 60.0)
    try:
        workers.start(2)
        assert dict(workers.results(lambda: False)) == dict.fromkeys(range(10))
    finally:
        workers.terminate_workers()


def test_each_file_is_compiled_once_to_try_its_runs(tmp_path):
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
