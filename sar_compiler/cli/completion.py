"""Completion in shells: the command `sar-compile completion`, and the functions that offer values for arguments.

This module and argcomplete are only imported when a shell requests completion (`CommandParser.complete`).
"""

import argparse
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.metadata import distribution
from pathlib import Path
from typing import TYPE_CHECKING, Any

from argcomplete.completers import DirectoriesCompleter, FilesCompleter
from argcomplete.shell_integration import shellcode

from sar_compiler.cli.arguments import ArgumentKind
from sar_compiler.commands import OK
from sar_compiler.nodes.palettes import palette_names
from sar_compiler.resources import shipped_root
from sar_compiler.tree.display_text import escape_to_one_line

if TYPE_CHECKING:
    from sar_compiler.project import Workspace

SHELLS = ("bash", "zsh", "fish")

_tree_files = FilesCompleter(("xml", "yaml", "yml"))
_yaml_files = FilesCompleter(("yaml", "yml"))


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `completion`."""
    parser.add_argument("shell", choices=SHELLS, help="the shell to print the code for")
    parser.epilog = (
        'Add this line to your start-up file, such as ~/.bashrc: eval "$(sar-compile completion bash)"'
    )
    parser.set_defaults(run=print_code)


def print_code(arguments: argparse.Namespace) -> int:
    """Print the code for a shell, and return the exit status."""
    scripts = distribution("sar_compiler").entry_points.select(group="console_scripts")
    print(shellcode(sorted(scripts.names), shell=arguments.shell))
    return OK


def add_completers(parser: argparse.ArgumentParser) -> None:
    """Add functions that complete values to all arguments of a parser and its subcommands."""
    for action in parser._actions:  # noqa: SLF001 - argparse has no other access to them
        if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001
            for command in action.choices.values():
                add_completers(command)
        elif action.choices is None and action.nargs != 0:
            # argcomplete reads this attribute; without it, it offers files.
            kind = action.type.name if isinstance(action.type, ArgumentKind) else ""
            action.completer = COMPLETERS[kind]  # type: ignore[attr-defined]


def _no_completions(**_: Any) -> tuple[str, ...]:
    return ()


def _list_shipped(folder: str, suffix: str) -> Iterator[str]:
    return (path.stem for path in (shipped_root() / folder).glob(f"*{suffix}"))


def _trees(prefix: str, **_: Any) -> list[str]:
    return [*_list_shipped("trees", ".xml"), *_tree_files(prefix)]


def _worlds(prefix: str, **_: Any) -> list[str]:
    return [*_list_shipped("worlds", ".yaml"), *_yaml_files(prefix)]


def _ids(parsed_args: argparse.Namespace, **_: Any) -> Iterable[str]:
    """Return the IDs of the trees in the file that the incomplete command line names."""
    trees = _workspace(parsed_args).load(parsed_args.file).forest.trees
    return [name for name in trees if escape_to_one_line(name) == name]


def _tags(parsed_args: argparse.Namespace, **_: Any) -> list[str]:
    return [spec.tag for spec in _workspace(parsed_args).current_project().vocabulary.specs()]


def _workspace(parsed_args: argparse.Namespace) -> "Workspace":
    """Return the workspace that the incomplete command line specifies, but ignore `--trust`."""
    from sar_compiler.cli.arguments import additions
    from sar_compiler.project import Workspace

    return Workspace(additions(parsed_args)._replace(trust=False))


def _codes(**_: Any) -> Mapping[str, str]:
    from sar_compiler.tree.kinds import KINDS

    return KINDS


def _missions(**_: Any) -> Iterable[str]:
    from sar_compiler.missions.mission_choice import load_missions

    return load_missions()


def _palettes(prefix: str, **arguments: Any) -> list[str]:
    return [*palette_names(), *FilesCompleter(("xml", "btproj"))(prefix, **arguments)]


def _modules(prefix: str, **_: Any) -> Iterator[str]:
    """Yield the modules and packages in the current folder, or in the package that the typed prefix names."""
    folder = Path(*prefix.split(".")[:-1])
    for path in folder.glob("*"):
        if path.stem.isidentifier() and (path.suffix == ".py" or any(path.glob("*.py"))):
            yield ".".join((*folder.parts, path.stem))


COMPLETERS: Mapping[str, Callable[..., Iterable[str]]] = {
    "": _no_completions,
    "code": _codes,
    "file": FilesCompleter(),
    "folder": DirectoriesCompleter(),
    "mission": _missions,
    "module": _modules,
    "palette": _palettes,
    "tag": _tags,
    "tree": _trees,
    "tree's ID": _ids,
    "world": _worlds,
    "YAML file": _yaml_files,
}
"""The functions that offer values for an argument, by `ArgumentKind.name`; the key "" is for arguments without completion."""
