"""Adds the description, the shipped files and the compiled kernel to the settings in pyproject.toml. colcon needs this file, too."""

import hashlib
import importlib.util
import json
import os
import re
import sys
from pathlib import Path

from setuptools import Distribution, Extension, setup
from setuptools.command.build_ext import build_ext

SHARE = "share/sar_compiler"
# The folders that are installed in share/sar_compiler.
SHIPPED = ("config", "docs/findings", "examples", "launch", "maps", "rviz", "schemas", "trees", "worlds")


def data_files() -> "list[tuple[str, list[str]]]":
    """Return the files to install outside the package, as pairs of a target folder and its files."""
    folders = {
        "share/ament_index/resource_index/packages": ["resource/sar_compiler"],
        # `colcon build --symlink-install` runs this file in a folder that contains only the data files. So these include pyproject.toml
        # and the files that it refers to.
        SHARE: ["package.xml", "pyproject.toml", "README.md", "LICENSE"],
    }
    for path in sorted(path for top in SHIPPED for path in Path(top).rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            folders.setdefault(f"{SHARE}/{path.parent.as_posix()}", []).append(path.as_posix())
    return list(folders.items())


def description() -> str:
    """Return the README without pictures and relative links, which would be broken on a package index."""
    text = re.sub(r"!\[.*?\]\(.*?\)\n*", "", Path("README.md").read_text(encoding="utf-8"))
    return re.sub(r"\[([^][]+)\]\((?!https?:)[^)]*\)", r"\1", text)


KERNEL = (Path("sar_compiler/runtime/kernel"), Path("sar_compiler/analysis/state_search"))
RECORD = KERNEL[0] / "compiled.json"
_OF_METADATA = {"dist_info", "egg_info"}
OPTIONS = ("--config-file=", "--ignore-missing-imports", "--follow-imports=silent")


def kernel() -> "list[Extension]":
    """Translate the modules of the kernel to C, and return them as extensions.

    The kernel also works without compilation, so a failure does not fail the build.
    """
    from mypyc.build import mypycify

    sources = sorted(path for folder in KERNEL for path in folder.glob("*.py") if path.stem != "__init__")
    # A compiled module is used only with the source from which it was compiled, so the digests are computed before mypyc reads the sources.
    digests = {
        ".".join(path.with_suffix("").parts): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sources
    }
    arguments = [*OPTIONS, "--python-executable", sys.executable, *map(str, sources)]
    try:
        # The same variable as in mypy's setup.py. A lower level halves the build time, but the kernel is slower.
        opt_level = os.environ.get("MYPYC_OPT_LEVEL", "3")
        modules = mypycify(arguments, opt_level=opt_level, debug_level="0", group_name="sar_compiler_kernel")
    except (Exception, SystemExit) as error:  # noqa: BLE001 - mypyc raises many types
        sys.stderr.write(f"the kernel is not compiled: {error}\n")
        return []
    for module in modules:
        module.optional = True
        # Warnings about generated C code are useless, and take a third of the compilation time.
        module.extra_compile_args.append("-w")
        # With hidden symbols, functions call each other directly, and small functions are inlined.
        # With Python's -Wall, gcc also checks the indentation, even with -w, which takes 25 s.
        if os.name != "nt":
            module.extra_compile_args += ["-fvisibility=hidden", "-Wno-misleading-indentation"]
            # No C++ exception passes through the kernel, so it needs no unwind tables, which are a tenth of its size.
            module.extra_compile_args += ["-fno-asynchronous-unwind-tables", "-fno-unwind-tables"]
        # The kernel is a third of the wheel, and debug symbols are a tenth of the kernel.
        if sys.platform == "linux":
            module.extra_link_args.append("-Wl,--strip-all")
    RECORD.write_text(json.dumps(digests, indent=1) + "\n", encoding="utf-8")
    return modules


class KernelBuild(build_ext):
    """Runs mypyc only for a build, because tools also run this file to read the metadata."""

    def finalize_options(self) -> None:
        """Set the extensions to compile. colcon's `--symlink-install` reads them, even if there are none."""
        self.distribution.ext_modules = kernel() if self.distribution.has_ext_modules() else []
        super().finalize_options()


class KernelDistribution(Distribution):
    """Has extensions if mypyc is installed, unless `SAR_KERNEL=python` is set or only the metadata is read."""

    def has_ext_modules(self) -> bool:
        """Return whether the kernel is compiled."""
        # pip reads the metadata first. For this, setuptools would run mypyc to list all sources.
        asked = getattr(self, "commands", [])
        is_wanted = os.environ.get("SAR_KERNEL") != "python" and (not asked or {*asked} - _OF_METADATA)
        return bool(is_wanted) and importlib.util.find_spec("mypyc") is not None


distribution = setup(
    long_description=description(),
    long_description_content_type="text/markdown",
    data_files=data_files(),
    distclass=KernelDistribution,
    cmdclass={"build_ext": KernelBuild},
)
# colcon prints the values of the distribution and parses them again, which fails with a SpecifierSet.
for holder in (distribution, distribution.metadata):
    holder.python_requires = str(holder.python_requires)
