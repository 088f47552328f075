"""Assemble the graphical editor of the site: `python docs/site/studio.py FOLDER CACHE`, see `make site`.

The page is that of `sar-compile edit`, with another back end (`docs/studio`): Pyodide from npm, and an archive of the package with its
dependencies. The site itself serves all files of the editor. Downloaded files are kept in the cache.
"""

import json
import re
import shutil
import subprocess
import sys
import zipfile
from importlib.metadata import distribution
from pathlib import Path

import yaml

from sar_compiler import style
from sar_compiler.views.drawing import drawing_style

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "sar_compiler" / "studio" / "static"
BACKEND = ROOT / "docs" / "studio"
PYODIDE = "314.0.7"
_OF_PYODIDE = ("pyodide.mjs", "pyodide.asm.mjs", "pyodide.asm.wasm", "python_stdlib.zip", "pyodide-lock.json")
# The folders of shipped files that checks, proofs and simulated runs read.
_SHIPPED = ("config", "schemas", "trees")


def assemble(folder: Path, cache: Path) -> None:
    """Write the editor into a new folder.

    Args:
        folder: The folder.
        cache: The folder in which Pyodide and wheels are kept.
    """
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "pyodide").mkdir(parents=True)
    # The back end of the site replaces that of the page.
    for path in (*PAGE.iterdir(), *BACKEND.glob("*.*js")):
        shutil.copy(path, folder / path.name)
    for name, content in (("signs.css", style.style()), ("drawing.css", drawing_style())):
        (folder / name).write_text(content, encoding="utf-8")
    shutil.copytree(BACKEND / "examples", folder / "examples")
    shutil.copy(ROOT / "trees/search_and_rescue.xml", folder / "examples")
    for name in _OF_PYODIDE:
        shutil.copy(_pyodide(cache) / name, folder / "pyodide" / name)
    with zipfile.ZipFile(folder / "packages.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for wheel in _wheels(cache):
            with zipfile.ZipFile(wheel) as opened:
                for name in opened.namelist():
                    archive.writestr(name, opened.read(name))
        for path in sorted(Path(yaml.__file__).parent.glob("*.py")):
            archive.write(path, f"yaml/{path.name}")
        for path in _package():
            archive.write(path, path.relative_to(ROOT))
        for path in (ROOT / "package.xml", *(path for top in _SHIPPED for path in (ROOT / top).rglob("*.*"))):
            archive.write(path, Path("share/sar_compiler") / path.relative_to(ROOT))
        for name in ("METADATA", "entry_points.txt"):
            text = distribution("sar_compiler").read_text(name)
            archive.writestr(f"sar_compiler-0.dist-info/{name}", text or "")
        archive.write(BACKEND / "site_engine.py", "site_engine.py")
    loaded = [folder / "packages.zip", *(folder / "pyodide").glob("*[!s]")]
    sizes = {path.name: path.stat().st_size for path in loaded if path.suffix != ".mjs"}
    (folder / "sizes.js").write_text(f"export const sizes = {json.dumps(sizes)};\n", encoding="utf-8")


def _package() -> "list[Path]":
    """Return the files of the package and of the shipped mission, except for compiled modules."""
    kinds = {".py", ".css", ".json", ".xsd", ".yaml"}
    folders = (ROOT / "sar_compiler", ROOT / "search_and_rescue")
    found = (path for folder in folders for path in folder.rglob("*") if path.suffix in kinds)
    return sorted(path for path in found if path.name != "compiled.json")


def _pyodide(cache: Path) -> Path:
    folder = cache / f"pyodide-{PYODIDE}"
    if not folder.is_dir():
        made = cache / "npm"
        npm = shutil.which("npm") or "npm"
        done = ("--prefix", str(made), "--no-save", "--ignore-scripts", "--no-fund", "--no-audit", "--silent")
        made.mkdir(parents=True, exist_ok=True)
        subprocess.run((npm, "install", *done, f"pyodide@{PYODIDE}"), check=True)  # noqa: S603 - as asked
        (made / "node_modules" / "pyodide").rename(folder)
    return folder


def _wheels(cache: Path) -> "list[Path]":
    needs = BACKEND / "requirements.txt"
    folder = cache / "wheels"
    names = re.findall(r"^(\w+)==(\S+)", needs.read_text(encoding="utf-8"), re.MULTILINE)
    wanted = [f"{name}-{version}-*none-any.whl" for name, version in names]
    if not all([*folder.glob(each)] for each in wanted):
        options = (
            "--quiet",
            "--no-deps",
            "--require-hashes",
            "--only-binary",
            ":all:",
            "--platform",
            "any",
            "--dest",
            str(folder),
        )
        subprocess.run((sys.executable, "-m", "pip", "download", *options, "-r", str(needs)), check=True)  # noqa: S603 - as asked
    return [wheel for each in wanted for wheel in folder.glob(each)]


if __name__ == "__main__":
    assemble(Path(sys.argv[1]), Path(sys.argv[2]))
