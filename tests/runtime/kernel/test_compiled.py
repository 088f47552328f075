"""Tests of the choice of the kernel: the compiled one is used only if it was built from the sources beside it."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import sar_compiler
from sar_compiler.cli.compile import main
from sar_compiler.runtime import kernel

PACKAGE = Path(sar_compiler.__file__).parent
REPORT = (
    "from sar_compiler.runtime import kernel; from sar_compiler.runtime.kernel import tree_nodes; "
    "print(kernel.STATE, tree_nodes.__file__.endswith('.py'))"
)
needs_compiled_kernel = pytest.mark.skipif(
    kernel.STATE != "compiled", reason="there is no compiled kernel here"
)


def report(folder, wanted=""):
    """Return which kernel a process uses that finds the package in a folder, or its last line of error output."""
    library = [] if folder == PACKAGE.parent else [str(PACKAGE.parent)]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(folder), *library]),
        "SAR_KERNEL": wanted,
    }
    words = (
        [sys.executable, "-P", "-c", REPORT]
        if sys.version_info >= (3, 11)
        else [sys.executable, "-c", REPORT]
    )
    run = subprocess.run(words, env=environment, cwd=folder, capture_output=True, text=True, check=False)
    return run.stdout.strip() or run.stderr.strip().splitlines()[-1]


@pytest.fixture
def copy(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "sar_compiler", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


@needs_compiled_kernel
def test_compiled_kernel_is_used_if_built_from_current_sources(copy):
    assert report(copy) == "compiled False"


@needs_compiled_kernel
def test_stale_compiled_kernel_is_not_used(copy):
    changed = copy / "sar_compiler" / "runtime" / "kernel" / "turning.py"
    changed.write_text(changed.read_text(encoding="utf-8") + "# changed\n", encoding="utf-8")
    assert report(copy) == "stale True"
    assert report(copy, "compiled").startswith(
        "ImportError: SAR_KERNEL=compiled: the compiled kernel is stale"
    )


@needs_compiled_kernel
def test_environment_variable_selects_python_sources(copy):
    assert report(copy, "python") == "compiled True"


def test_missing_compiled_kernel_is_replaced_by_python_sources(copy):
    for binary in (copy / "sar_compiler" / "runtime" / "kernel").glob("*.so"):
        binary.unlink()
    assert report(copy) == "absent True"
    assert report(copy, "compiled").startswith(
        "ImportError: SAR_KERNEL=compiled: the compiled kernel is absent"
    )


def test_version_option_prints_kernel_in_use(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--version"])
    assert end.value.code == 0
    assert f"kernel: {kernel.describe()})" in capsys.readouterr().out


VERIFY = "sys.exit(main(['verify', 'trees/search_and_rescue.xml', '--format', 'json']))"
WITHOUT_LIBRT = """
import importlib.util, sys
missing, there = ('librt', 'mypy_extensions'), importlib.util.find_spec
importlib.util.find_spec = lambda name, *given: None if name in missing else there(name, *given)
sys.modules.update(dict.fromkeys(missing))
from sar_compiler.runtime import kernel
assert not kernel.IS_COMPILED
"""


def run_verify(before=""):
    program = f"import sys\nfrom sar_compiler.cli.compile import main\n{before}{VERIFY}"
    words = [sys.executable, "-c", program]
    run = subprocess.run(words, cwd=PACKAGE.parent, capture_output=True, text=True, check=False)
    return {**json.loads(run.stdout), "seconds": 0}, run.returncode, run.stderr


def test_verify_gives_same_result_without_librt():
    assert run_verify(WITHOUT_LIBRT) == run_verify()
