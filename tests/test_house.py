"""Tests of the architecture rules: imports between packages, unique names, and where files are opened and nodes are named."""

import ast
import collections
import functools
import importlib
import itertools
import re
import subprocess
import sys
from pathlib import Path

import pytest

from sar_compiler.nodes.palettes import palette_names
from sar_compiler.nodes.registry import load_registry
from sar_compiler.style import COLOURS
from tests.faults.test_hostile_files import ELSEWHERE as TRIED_ELSEWHERE
from tests.faults.test_hostile_files import SURFACES
from tests.readers import readers_in

# These tests read files and run almost no code; coverage would make them 1.5 times slower.
pytestmark = pytest.mark.unmeasured

PACKAGE = Path("sar_compiler")

MISSION = Path("search_and_rescue")

CORE = {
    "tree": set(),
    "runtime": set(),
    "nodes": {"tree", "runtime"},
    "compiler": {"tree", "runtime", "nodes"},
    "documents": {"tree", "nodes"},
    "checks": {"tree", "runtime", "nodes", "compiler", "documents"},
    "project": {"tree", "runtime", "nodes", "compiler", "documents", "checks"},
}
"""The other core packages that each core package may import."""
PARTS = {
    "journal": set(),
    "views": {"journal"},
    "missions": {"journal"},
    "analysis": {"journal", "missions"},
    "ros": {"journal", "missions", "views"},
    "groot2": {"ros", "views"},
    "importing": {"analysis", "journal", "ros", "views"},
    "reports": {"analysis", "journal", "ros", "views"},
    "sim": {"analysis", "missions", "ros"},
    "execution": {"analysis", "journal", "missions", "ros", "sim", "views"},
    "studio": {"analysis", "editing", "missions", "views"},
    "web": {"analysis", "execution", "journal", "missions", "reports", "ros", "studio", "views"},
    "agent": {"analysis", "missions", "views"},
    "editing": set(),
    "lsp": {"analysis", "editing", "missions", "views"},
    "validation": {"analysis"},
}
"""The other parts that each part may import, in addition to the core."""
MAY_IMPORT = {
    **CORE,
    **{part: others | CORE.keys() for part, others in PARTS.items()},
    "search_and_rescue": {"", "leaves", "missions", "testing"},
}
COMMON = {
    "budget",
    "commands",
    "console_command",
    "errors",
    "gc_pause",
    "helper_process",
    "json_values",
    "lazy_exports",
    "opener",
    "parts",
    "process_end",
    "resources",
    "style",
    "terminal",
    "writing",
}
"""The modules that every package may import."""
ABOVE = {"__init__", "cli", "leaves", "loaded_tree", "testing"}
"""The commands, and the public names of users."""


def name_of(path):
    """Return the path of a module as the tables write it: relative to `sar_compiler`, or to the checkout."""
    return str(path.relative_to(PACKAGE) if path.is_relative_to(PACKAGE) else path)


def package_of(path):
    return Path(name_of(path)).parts[0].removesuffix(".py")


class ModuleFacts:
    """The facts about a module that the rules need. Its syntax tree takes too much memory to be cached.

    Attributes:
        imports: The modules that it imports at any level, with the line.
        imports_without_types: The modules that it imports at run time.
        names: Its classes at any level and its type aliases, with the line.
        texts: The strings of its code, with the line.
        calls: The called expressions.
        computed_lookups: The lines that look up an attribute by a computed name.
        fields: The measured fields that it reads.
        readers: Its functions that read files named by users.
        functions: The names of its functions.
        methods: The names of the public methods of each class.
    """

    def __init__(self, path):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        nodes = [*ast.walk(tree)]
        self.imports = [*imports_in(nodes)]
        self.names = [*names_given_by(tree, nodes)]
        self.texts = [*texts_in(nodes)]
        self.calls = {source_of_expression(node.func) for node in nodes if isinstance(node, ast.Call)}
        self.computed_lookups = [*computed_lookups(tree)]
        self.fields = {*fields_read(nodes)}
        self.readers = readers_in(path, tree)
        self.functions = [node.name for node in nodes if isinstance(node, FUNCTIONS)]
        self.methods = [
            {each.name for each in node.body if isinstance(each, FUNCTIONS) and not each.name.startswith("_")}
            for node in nodes
            if isinstance(node, ast.ClassDef)
        ]
        tree.body = [
            node
            for node in tree.body
            if not (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")
        ]
        self.imports_without_types = [*imports_in(ast.walk(tree))]


FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
facts_of = functools.cache(ModuleFacts)


def source_of_expression(node):
    """Return the source of an expression. Most are dotted names, for which `ast.unparse` would be slow."""
    names, inner = [], node
    while isinstance(inner, ast.Attribute):
        names.append(inner.attr)
        inner = inner.value
    return ".".join([inner.id, *reversed(names)]) if isinstance(inner, ast.Name) else ast.unparse(node)


def imports_in(nodes):
    """Yield the modules that are imported, with the line."""
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from ((f"{node.module}.{alias.name}", node.lineno) for alias in node.names)


FILES = sorted([*PACKAGE.rglob("*.py"), *MISSION.rglob("*.py")])


@functools.cache
def is_public_group(path):
    """Return whether a module only lists public names, which are looked up lazily."""
    return "__all__ = lazy(__name__)" in path.read_text(encoding="utf-8")


@pytest.mark.parametrize("package", sorted(MAY_IMPORT))
def test_package_imports_only_allowed_packages(package):
    allowed = MAY_IMPORT[package] | COMMON | {package}
    wrong = [
        f"{path}:{line} imports {module}"
        for path in FILES
        if package_of(path) == package and not is_public_group(path)
        for module, line in facts_of(path).imports
        if (top := module.partition(".")[0]) in {PACKAGE.name, MISSION.name}
        and (f"{module}.".split(".")[1] if top == PACKAGE.name else top) not in allowed
    ]
    assert wrong == []


@functools.cache
def modules_of_parts_imported():
    """Return the modules of each part that others import."""
    found = collections.defaultdict(set)
    for path in FILES:
        for name, _ in () if is_public_group(path) else facts_of(path).imports:
            top, _, rest = name.partition(".")
            part, *module = rest.split(".")
            if top == PACKAGE.name and part in PARTS and part != package_of(path):
                while module and not any(
                    PACKAGE.joinpath(part, *module).with_suffix(end).exists() for end in ("", ".py")
                ):
                    module.pop()
                found[part].add(".".join(module))
    return {part: modules - {""} for part, modules in found.items()}


@pytest.mark.parametrize("part", sorted(PARTS))
def test_public_modules_of_part_match_imports_of_others(part):
    listed = importlib.import_module(f"{PACKAGE.name}.{part}").PUBLIC_MODULES
    assert listed == tuple(sorted(modules_of_parts_imported()[part]))


def test_no_part_names_the_command_line_package():
    named = [
        f"{path}:{line}"
        for path in FILES
        if package_of(path) not in {"cli", "commands", "console_command"}
        for text, line in facts_of(path).texts
        if "sar_compiler.cli" in text
    ]
    assert named == []


def test_every_package_has_an_import_rule():
    assert {package_of(path) for path in FILES} - COMMON - ABOVE == set(MAY_IMPORT)


def names_given_by(tree, nodes):
    """Yield the classes of a file at any level and its type aliases, with the line."""
    yield from ((node.name, node.lineno) for node in nodes if isinstance(node, ast.ClassDef))
    for node in tree.body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        for target in targets:
            if isinstance(target, ast.Name) and re.fullmatch(r"_?[A-Z][a-z]\w*", target.id):
                yield target.id, node.lineno


def find_duplicates(pairs):
    """Return the names that belong to more than one thing, with these things."""
    found = collections.defaultdict(list)
    for name, thing in pairs:
        found[name].append(thing)
    return {name: things for name, things in found.items() if len(things) > 1}


def test_class_names_are_unique():
    # A leading underscore does not make a different name, because both are spoken alike.
    given = ((name.lstrip("_"), f"{path}:{line}") for path in FILES for name, line in facts_of(path).names)
    assert find_duplicates(given) == {}


# A module may have the name of the module that it mirrors.
MIRRORS = {
    frozenset({"runtime", "nodes"}): "the tags of these nodes",
    frozenset({"views", "tree"}): "how it is shown",
    frozenset({"views", "nodes"}): "how they are shown",
    frozenset({"ros", "runtime"}): "what it is made of with ROS",
    frozenset({"cli", "ros"}): "the command for it",
}
# Modules that share a name without mirroring each other, with the reason.
SAME_MODULE_NAMES = {
    "errors.py": "each package has its own",
    "leaves.py": "what leaves are made of, beside the leaves of the language",
}


def test_module_names_are_unique_except_mirrors():
    twice = find_duplicates((path.name, package_of(path)) for path in FILES if path.stem != "__init__")
    unlike = {
        name
        for name, sides in twice.items()
        if any(frozenset(pair) not in MIRRORS for pair in itertools.combinations(sides, 2))
    }
    assert unlike == SAME_MODULE_NAMES.keys()


def test_shipped_mission_is_known_only_by_entry_point():
    said = [
        f"{path}:{number}"
        for path in PACKAGE.rglob("*")
        if path.suffix in {".py", ".js", ".html", ".css", ".yaml"}
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if MISSION.name in line
    ]
    assert said == []


def test_shipped_mission_imports_only_public_names():
    """The mission could be a separate distribution, so any user's mission can do the same."""
    groups = ("sar_compiler", "sar_compiler.leaves", "sar_compiler.missions", "sar_compiler.testing")
    public = {f"{group}.{name}" for group in groups for name in importlib.import_module(group).__all__}
    wrong = [
        f"{path}:{line} imports {module}"
        for path in MISSION.rglob("*.py")
        for module, line in facts_of(path).imports
        if module.startswith("sar_compiler.") and module not in public
        if not module.startswith("search_and_rescue.")
    ]
    assert wrong == []


def test_only_edge_packages_import_ros():
    edge = ("ros", "sim", "execution", "search_and_rescue")
    wrong = [
        f"{path}:{line} imports {module}"
        for path in FILES
        if not name_of(path).startswith(edge)
        for module, line in facts_of(path).imports_without_types
        if module.split(".")[0].endswith(("rclpy", "_msgs", "_srvs", "_interfaces"))
    ]
    assert wrong == []


WITHOUT_ROS = (
    "import sar_compiler",
    "import search_and_rescue.plugin",
    "from sar_compiler.missions.mission_choice import load_missions; load_missions()",
    "import sar_compiler.testing",
    "from sar_compiler.cli.compile import main; main(['validate', 'trees/search_and_rescue.xml'])",
    "from sar_compiler.cli.compile import main; main(['show', 'trees/search_and_rescue.xml'])",
    "from sar_compiler.cli.compile import main; main(['diff', *['trees/search_and_rescue.xml'] * 2])",
    "from sar_compiler.cli.compile import main; main(['nodes', '--format', 'groot2'])",
    "from sar_compiler.cli.compile import main; main(['convert', 'trees/search_and_rescue.xml', '--to', 'yaml'])",
    "from sar_compiler.cli.compile import main; main(['simulate', 'trees/search_and_rescue.xml'])",
    "from sar_compiler.cli.compile import main; main(['verify', 'trees/search_and_rescue.xml'])",
    "import sar_compiler.cli.run",
    "import sar_compiler.cli.sim",
)


def test_commands_that_need_no_ros_work_without_rclpy():
    # Libraries are imported once; each statement runs in a separate process.
    program = (
        "import os, sys; sys.modules['rclpy'] = None\n"
        "import jsonschema, lxml.etree, numpy, py_trees, scipy.sparse, yaml\n"
        "for statement in sys.argv[1:]:\n"
        "    if not os.fork(): exec(statement); sys.exit()\n"
        "    if os.wait()[1]: sys.stderr.write(f'failed: {statement}')\n"
    )
    command = [sys.executable, "-c", program, *WITHOUT_ROS]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "failed: " not in done.stderr, done.stderr
    assert done.returncode == 0


LOOKS_UP = {"getattr", "setattr", "hasattr", "delattr", "attrgetter", "methodcaller"}
COMPUTED_ELSEWHERE = {"runtime/kernel/branching.py"}
"""The ports of a Switch: `case_1`, `case_2`, … as many as it has children."""


def computed_lookups(tree):
    """Yield the lines of a module that look up an attribute by a computed string, directly or through a local variable."""
    for scope in ast.walk(tree):
        if not isinstance(scope, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda, ast.Module)):
            continue
        nodes = [*ast.walk(scope)]
        # Only local variables of functions are followed.
        computed = {
            target.id
            for node in (() if isinstance(scope, ast.Module) else nodes)
            if isinstance(node, (ast.Assign, ast.NamedExpr, ast.AnnAssign)) and is_computed_text(node.value)
            for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
            if isinstance(target, ast.Name)
        }
        for node in nodes:
            if isinstance(node, ast.Call) and called_name(node) in LOOKS_UP:
                for name in node.args:
                    if is_computed_text(name) or (isinstance(name, ast.Name) and name.id in computed):
                        yield node.lineno


def called_name(node):
    """Return the name of the called function without its object or module."""
    return getattr(node.func, "attr", getattr(node.func, "id", ""))


def is_computed_text(node):
    """Return whether an expression builds a string: `f"on_{kind}"`, `"on_" + kind`, `"on_%s" % kind`, `"on_{}".format(kind)`."""
    if isinstance(node, ast.NamedExpr):
        return is_computed_text(node.value)
    if isinstance(node, ast.Call):
        return called_name(node) in {"format", "join", "replace"}
    if isinstance(node, ast.BinOp):
        return any(
            is_computed_text(side) or (isinstance(side, ast.Constant) and isinstance(side.value, str))
            for side in (node.left, node.right)
        )
    return isinstance(node, ast.JoinedStr)


@pytest.mark.parametrize(
    "text",
    [
        'getattr(a, f"on_{k}", None)',
        'getattr(a, "on_" + k)',
        'getattr(a, k + "_" + k)',
        'operator.methodcaller("on_%s" % k)',
        'setattr(a, "on_{}".format(k), 1)',
        'def f(a, k):\n    name = f"on_{k}"\n    getattr(a, name)',
        'def f(a, k):\n    name: str = "on_" + k\n    return getattr(a, name)',
        'if hasattr(a, name := "_".join(k)): ...',
    ],
)
def test_computed_attribute_lookup_is_detected(text):
    assert [*computed_lookups(ast.parse(text))]
    assert not [
        *computed_lookups(ast.parse('def f(a, k):\n    name = NAMES[k]\n    return getattr(a, name, "")'))
    ]


def test_no_attribute_is_looked_up_by_computed_name():
    """Names that are looked up must be in tables, so that a text search finds them."""
    found = {name_of(path) for path in FILES if facts_of(path).computed_lookups}
    assert found == COMPUTED_ELSEWHERE


MAKES_CODE = "runtime/script_code.py"
"""Compiles its own syntax trees, which contain no text of a file (`tests/runtime/test_script_code.py` checks them)."""


def test_no_code_from_files_is_evaluated():
    found = {
        (name_of(path), name)
        for path in FILES
        for name in facts_of(path).calls & {"eval", "exec", "compile", "types.FunctionType", "FunctionType"}
    }
    assert found == {(MAKES_CODE, "compile"), (MAKES_CODE, "types.FunctionType")}


MEASURED = frozenset(
    {
        *("percentage", "voltage", "temperature", "ranges", "latitude", "longitude", "altitude"),
        *("frame_id", "child_frame_id", "header", "stamp", "covariance"),
        *(
            "position",
            "orientation",
            "translation",
            "rotation",
            "resolution",
            "origin",
            "twist",
            "linear",
            "angular",
        ),
        *("distance_remaining", "estimated_time_remaining", "number_of_poses_remaining"),
        *("survivor_x", "survivor_y"),
    }
)
"""The fields of messages that a sensor or a server sets."""
READ_ELSEWHERE = {
    "web/page_tools.py": {"stamp"},  # of a key of the blackboard
    "search_and_rescue/actions/survivors.py": {"survivor_x", "survivor_y"},  # into `MapExtent.check`
    "search_and_rescue/coverage.py": {"origin", "resolution"},  # of an `ObstacleMap`
    "search_and_rescue/operator_commands.py": {"orientation", "position"},  # fills in a request
    "search_and_rescue/sweeps.py": {"resolution"},  # of an `ObstacleMap`
    "ros/mission_publisher.py": {"frame_id", "header"},  # of markers that it has made
    "missions/parameter_file.py": {"position"},  # in a text
}


def fields_read(nodes):
    """Yield the measured fields that a file reads, without those that it sets."""
    written = set[ast.AST]()
    for node in nodes:
        if isinstance(node, ast.Assign):
            targets = node.targets
        elif isinstance(node, ast.Call) and called_name(node).endswith("turn_by"):
            targets = node.args[:1]
        else:
            continue
        written.update(each for target in targets for each in ast.walk(target))
    for node in nodes:
        if isinstance(node, ast.Attribute) and node.attr in MEASURED and node not in written:
            yield node.attr


def test_measured_message_fields_are_read_in_one_module():
    """`ros/message_values.py` checks the values of sensors and servers against the definitions of their messages."""
    found = {
        name: fields
        for path in FILES
        if (name := name_of(path)).startswith(
            ("ros/", "missions/", "search_and_rescue/", "execution/", "web/", "cli/", "leaves")
        )
        and name != "ros/message_values.py"
        and (fields := facts_of(path).fields)
    }
    assert found == READ_ELSEWHERE


# The calls by which Python and the libraries of this project open or read a file.
OPENS = re.compile(
    r"(?:^|\.)(?:open|fdopen|open_code|read_text|read_bytes|memmap|fromfile|loadtxt|genfromtxt|getlines?|run_path|copyfile|copy2"
    r"|copytree|ZipFile|TarFile|FileIO|iterparse|get_data)$"
    r"|^(?:sqlite3\.connect|np\.load|shutil\.copy|(?:etree|ET)\.parse|(?:json|pickle|tomllib|yaml)\.load|yaml\.parse|mmap\.mmap)$"
)
OWN, TEXT, WRITTEN = "a file of the package", "no file, but a text or bytes", "written, not read"
OPENED_ELSEWHERE = {
    "budget.py": {"Path('/proc/self/statm').read_text": "the system's count of this process's memory"},
    "web/edit_page.py": {"path.read_bytes": OWN},
    "web/run_page.py": {"webbrowser.open": "an address"},
    "cli/repeated_runs.py": {"os.fdopen": "a descriptor of its own"},
    "execution/supervisor.py": {"open": "a descriptor of its own"},
    "writing.py": {"new.open": WRITTEN, "target.open": WRITTEN},
    "commands.py": {"open": "/dev/null, in place of a closed stream"},
    "documents/located.py": {"shared_file_path('schemas', f'sar_{schema}.schema.json').read_bytes": OWN},
    "importing/bag.py": {"os.fdopen": "a descriptor that the opener has checked"},
    "importing/sqlite_log.py": {"sqlite3.connect": "as in journal/database.py"},
    "lazy_exports.py": {"spec.loader.get_data": OWN},
    "journal/database.py": {
        "cls.open": "its own method",
        "os.open": "a lock, a folder to flush, and a journal to write: fstat says that it is a file",
        "sqlite3.connect": "SQLite takes names alone; open_by_name requires that it opens the file that was checked",
    },
    "journal/journal_opening.py": {"JournalFile.open": "the method above"},
    "journal/spill_file.py": {"os.open": "to write; fstat says that it is a file"},
    "nodes/declared.py": {"path.read_text": OWN},
    "nodes/nav2/__init__.py": {"Path(__file__).with_name('nodes.yaml').read_text": OWN, "yaml.load": TEXT},
    "nodes/schemas/xml_schema.py": {"Path(__file__).with_name('frame.xsd').read_text": OWN},
    "ros/guardian.py": {"Path(beat.stack).read_text": "the stack that the guarded process itself writes"},
    "ros/middleware.py": {"os.open": "a lock; its content is not read"},
    "ros/mission_recording.py": {"path.open": WRITTEN},
    "missions/parameter_file.py": {"yaml.parse": TEXT},
    "runtime/kernel/__init__.py": {"_RECORD.read_bytes": OWN, "path.read_bytes": OWN},
    "style/__init__.py": {"Path(__file__).with_name('marks.css').read_text": OWN},
    "sim/simulated_runs.py": {"path.open": "a lock; its content is not read"},
    "sim/isolation.py": {"path.read_text": "the system's lists of sockets, in /proc"},
    "sim/occupancy.py": {"Image.open": TEXT},
    "tree/yaml_events.py": {
        "Path(__file__).with_name('yaml_mistakes.yaml').read_text": OWN,
        "yaml.load": TEXT,
        "yaml.parse": TEXT,
    },
    "views/drawing.py": {"files(__package__).joinpath('drawing.css').read_text": OWN},
    "views/findings.py": {"shared_file_path('docs/findings', f'{code}.md').read_text": OWN},
    "analysis/prediction_view.py": {"files(__package__).joinpath('prediction.css').read_text": OWN},
    "reports/report_html.py": {
        "files(__package__).joinpath('report.css').read_text": OWN,
        "files(__package__).joinpath('report.html.jinja').read_text": OWN,
    },
    "web/page_server.py": {"path.read_bytes": OWN},
}
"""The modules that open a file without the opener, with the reason."""


def test_only_the_opener_opens_files():
    found = {
        name_of(path): names
        for path in FILES
        if (names := {name for name in facts_of(path).calls if OPENS.search(name)})
    }
    del found["opener.py"]
    assert found == {path: names.keys() for path, names in OPENED_ELSEWHERE.items()}


def test_each_file_reader_is_tested_with_hostile_files():
    """If this fails, add a surface of the new reader to `SURFACES`, which tests it with pipes, links, long names, and so on."""
    tried = {reader for surface in SURFACES.values() for reader in surface.readers}
    readers = set().union(*(facts_of(path).readers for path in FILES))
    assert readers == tried | TRIED_ELSEWHERE.keys()


# The modules that define or write nodes. No other module may name a node in a string.
NODE_MODULES = (
    "nodes/language/",  # what each tag means
    "nodes/btcpp/",  # writes trees in BehaviorTree.CPP's nodes
    "nodes/nav2/",  # what each tag of Nav2 means
    "search_and_rescue/",  # registers its leaves
)
NAMED_ELSEWHERE = {
    "tree/model.py": {"SubTree"},  # a part of the file's grammar, before any node has a meaning
    "editing/operations.py": {"Fallback", "Inverter", "Sequence"},  # the usual ones around another node
    "tree/yaml_fields.py": {
        "Condition",  # the explicit form, <Condition ID="...">, not py_trees' decorator
        "RosAction",  # whose attributes are YAML themselves, which is read before any node has a meaning
        "RosPublish",
        "RosService",
        "RosTopic",
    },
    "nodes/spec.py": {"Condition"},  # the kind, too
    # Those that a log of BehaviorTree.CPP shows as RUNNING only after their child; nothing else depends on it.
    "importing/ticks.py": {
        "PipelineSequence",
        "Precondition",
        "SkipUnlessUpdated",
        "WaitValueUpdate",
    },
    "sim/navigator.py": {
        "FollowPath"
    },  # the name that Nav2 gives a plugin of its controller, if its parameters do not
    "runtime/kernel/cells.py": {"ForEach"},  # the name of a class that an old py_trees does not have
}


def texts_in(nodes):
    """Yield the strings of a file's code with the line, without docstrings, annotations and parts of messages."""
    passed: set[ast.AST] = set()
    for node in nodes:
        if isinstance(node, ast.Expr):
            passed.add(node.value)
        elif isinstance(node, ast.JoinedStr) and len(node.values) > 1:
            passed.update(ast.walk(node))
        else:
            passed.update(each for name in ("annotation", "returns") if (each := getattr(node, name, None)))
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in passed:
            yield node.value, node.lineno


def test_node_tags_are_named_only_in_their_modules():
    known = load_registry(palettes=palette_names())
    former = {tag for spec in known.specs() for tag in spec.former_tags}
    tags = {*known.by_tag(), *former, "SubTree"}
    named = [
        (name, text, f"{path}:{line} names <{text}>; ask its record (nodes.semantics)")
        for path in FILES
        if not (name := name_of(path)).startswith(NODE_MODULES)
        for text, line in facts_of(path).texts
        if text in tags
    ]
    allowed = {(name, text) for name, texts in NAMED_ELSEWHERE.items() for text in texts}
    assert [said for name, text, said in named if (name, text) not in allowed] == []
    assert allowed - {(name, text) for name, text, _ in named} == set()


MISSION_WORD = re.compile(r"\w*(?:zone|survivor|rescue|base_station)\w*|\bhome\b", re.IGNORECASE)
"""Words of the shipped mission, which packages that show, store or run any mission must not contain."""
MISSION_WORDS_ELSEWHERE = {
    "journal/display.py": {"timezone"},
    "reports/report_exchange.py": {"timezone", "RESCUE"},  # a category of the Common Alerting Protocol
    "reports/report_html.py": {"astimezone"},
    "web/static/tree_view.js": {"Home"},  # a key of the keyboard
    "sim/world.py": {"disaster_zone", "zones"},  # a shipped world; the key of its file
    "cli/arguments.py": {"disaster_zone"},  # the world of --sim
    "cli/run.py": {"disaster_zone"},  # the help of --sim
    "analysis/approval.py": {"timezone"},
}


def test_mission_words_occur_only_in_mission_package():
    packages = ("journal", "views", "web", "groot2", "ros", "sim", "cli", "execution", "reports", "analysis")
    said = {
        name: words
        for path in (*FILES, *PACKAGE.glob("web/static/*.*"))
        if (name := name_of(path)).startswith(packages)
        and (words := set(MISSION_WORD.findall(path.read_text(encoding="utf-8"))))
    }
    assert said == MISSION_WORDS_ELSEWHERE


NAMED_COLOURS = "white|black|gr[ae]y|red|green|blue|orange|yellow|cyan|gold|purple"
COLOUR = re.compile(
    r"#(?:[\da-f]{8}|[\da-f]{6}|[\da-f]{3,4})\b(?!;)|\b(?:rgb|hsl)a?\(\s*[\d{]"
    rf"|\b(?:fill|fillcolor|color|stroke|background)[\"']?\s*[:=]\s*[\"']?(?:{NAMED_COLOURS})\b",
    re.IGNORECASE,
)
"""A colour in CSS, SVG, Graphviz or Mermaid."""
COLOURED_ELSEWHERE = {
    "sar_compiler/web/static/icon.svg": "the tab of a browser draws it without the page's stylesheet",
}
# `make editor` bundles CodeMirror, whose style is not ours. The file exists only after that.
BUNDLED = PACKAGE / "studio/static/codemirror.js"


def test_colours_are_defined_only_in_style_package():
    drawn = (
        *(PACKAGE.rglob(f"*.{ending}") for ending in ("py", "css", "js", "html", "svg")),
        Path("docs/pictures").glob("*.py"),
    )
    coloured = {
        str(path)
        for path in itertools.chain(*drawn)
        if path != BUNDLED and COLOUR.search(path.read_text(encoding="utf-8"))
    }
    assert coloured == {"sar_compiler/style/__init__.py", *COLOURED_ELSEWHERE}


def test_stylesheets_use_exactly_the_defined_colours():
    sizes = {"large", "title", "body", "small"}
    own = {"level", "map", *sizes, *COLOURS}
    used = {
        (str(path), name)
        for path in PACKAGE.rglob("*.css")
        for name in re.findall(r"var\(--([a-z-]+)", path.read_text(encoding="utf-8"))
    }
    assert {(path, name) for path, name in used if name not in own} == set()
    # Every colour is used by a stylesheet.
    assert {*COLOURS} - {name for _, name in used} == set()


def test_journal_modules_are_imported_only_with_a_journal():
    program = (
        "import sys\n"
        "import sar_compiler.execution.run_journal, search_and_rescue.plugin\n"
        "from search_and_rescue.record import MissionRecord\n"
        "MissionRecord().base_reached()\n"
        "print(*sorted({'sqlite3', 'sar_compiler.journal.database'} & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("\n", "")


@pytest.mark.ros
def test_view_and_report_libraries_are_imported_only_on_request():
    program = (
        "import sys, sar_compiler.execution.node_run\n"
        "print(*sorted({'rich', 'pyproj', 'sqlite3', 'sar_compiler.journal.mission_state'} & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("\n", "")


ARCHITECTURE = Path("docs/contributing/architecture.md").read_text(encoding="utf-8")
HOW_TO_ADD = ARCHITECTURE.partition("\n## How to add\n")[2].split("\n## ")[0]
# A text that looks like a file: it has a folder or a suffix.
NAMED_FILE = re.compile(r"[\w.]+/[\w./-]*|[\w-]+\.(?:py|js|md|toml|yaml|xml|json|css|html)")
NAMED_MODULE = re.compile(r"([a-z]\w*)((?:\.[a-z]\w*)+)")


def find_named(name):
    """Return the files that a code span names: a path (capitals are a wildcard) or a module of a package; None for other spans."""
    if NAMED_FILE.fullmatch(name):
        return [each for root in (Path(), PACKAGE) for each in root.glob(re.sub("[A-Z]{3,}", "*", name))]
    module = NAMED_MODULE.fullmatch(name)
    if module and (PACKAGE / module[1]).is_dir():
        path = PACKAGE.joinpath(*name.split("."))
        return [each for each in (path, path.with_suffix(".py")) if each.exists()]
    return None


def test_methods_named_on_architecture_page_exist():
    texts = [path.read_text(encoding="utf-8") for path in FILES]
    missing = [
        f"{of}.{name}"
        for of, name in re.findall(r"`([A-Z]\w+)\.(\w+)", ARCHITECTURE)
        if not any(re.search(rf"^class {of}\b(?s:.*)\b{name}\b", text, re.MULTILINE) for text in texts)
    ]
    assert missing == []


@pytest.mark.parametrize("entry", HOW_TO_ADD.split("\n### ")[1:], ids=lambda entry: entry.partition("\n")[0])
def test_every_file_named_under_how_to_add_exists(entry):
    named = {name: find_named(name) for name in re.findall("`([^`\n]+)`", entry)}
    files = {name: found for name, found in named.items() if found is not None}
    assert files
    assert [name for name, found in files.items() if not found] == []


def groups_that_import_each_other(imports):
    """Return the groups of modules that import each other directly or indirectly (Tarjan's algorithm)."""
    index, low = dict[str, int](), dict[str, int]()
    stack, groups = list[str](), list[frozenset[str]]()

    def visit(module):
        index[module] = low[module] = len(index)
        stack.append(module)
        for other in imports[module]:
            if other not in index:
                visit(other)
            if other in stack:
                low[module] = min(low[module], low[other])
        if low[module] == index[module]:
            group = stack[stack.index(module) :]
            del stack[stack.index(module) :]
            groups.append(frozenset(group))

    for module in imports:
        if module not in index:
            visit(module)
    return {group for group in groups if len(group) > 1}


def test_import_cycle_is_detected():
    assert groups_that_import_each_other({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == {
        frozenset("abc")
    }
    assert groups_that_import_each_other({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == set()


def test_modules_have_no_import_cycles():
    """Imports at module level, in functions, and for types count."""
    modules = {
        ".".join(Path(name_of(path)).with_suffix("").parts).removesuffix(".__init__"): path
        for path in FILES
        if not is_public_group(path)
    }

    def module_of(name):
        parts = name.removeprefix(f"{PACKAGE.name}.").split(".")
        return next(
            (".".join(parts[:end]) for end in range(len(parts), 0, -1) if ".".join(parts[:end]) in modules),
            None,
        )

    imports = {
        module: {module_of(name) for name, _ in facts_of(path).imports} & modules.keys() - {module}
        for module, path in modules.items()
    }
    assert groups_that_import_each_other(imports) == set()


INTERFACES = {
    "add", "add_entry", "apply", "begin", "branch_count", "check", "close", "create", "end", "end_tick", "enter", "get", "goal",
    "initialise", "load", "name", "now", "on_child_outcome", "on_compiled", "on_end", "on_entry", "on_failure", "on_response", "path", "poll",
    "read", "resume", "root", "run", "setup", "shutdown", "start", "step", "stop", "stop_first", "stop_last", "terminate", "tick",
    "update", "write",
}  # fmt: skip
"""Names of methods that many classes have: py_trees' behaviours, kernel nodes, leaves, clocks, simulated devices, listeners and
run extensions, or classes that act like containers and files."""
PREPOSITION = re.compile(
    r"about|above|after|against|along|around|as|at|before|behind|below|beside|between|by|for|from|in|into|of|on|onto|over|since"
    r"|through|to|under|until|upon|with|within|without"
)
PARTICIPLE = re.compile(
    r"[a-z]+(?<!e)ed|[a-z]{3,}ing|begun|bound|broken|built|chosen|come|done|drawn|driven|fed|forgotten|found|given|gone|grown|held|hidden"
    r"|kept|known|led|left|lost|made|meant|met|paid|said|seen|sent|shown|sought|spent|stood|taken|thought|told|worn|written"
)
NOUNS = {
    "anything",
    "binding",
    "drawing",
    "embed",
    "finding",
    "mapping",
    "nothing",
    "recording",
    "setting",
    "string",
    "warning",
}


def test_method_of_many_classes_is_a_listed_interface():
    classes = collections.Counter(
        name for path in FILES for names in facts_of(path).methods for name in names
    )
    wide = {name: count for name, count in classes.items() if count > 5 and name not in INTERFACES}
    assert wide == {}
    assert {name for name in INTERFACES if classes[name] <= 5} == set()


def test_function_name_is_no_bare_participle_or_preposition():
    names = {
        given
        for path in FILES
        for given in facts_of(path).functions
        if not given.startswith("__")
        if (name := given.strip("_")) not in NOUNS
        if PREPOSITION.fullmatch(name) or PARTICIPLE.fullmatch(name)
    }
    assert names == set()
