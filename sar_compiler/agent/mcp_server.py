"""The project's commands as tools of the Model Context Protocol, for agents that write trees.

Each call runs `sar-compile` in a process, which ends with the call or after a time limit. The process limits its own
memory, and reads only files in the given folders (`agent.call_limits`) and shipped trees. No tool writes or approves a
file.
"""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from subprocess import DEVNULL
from typing import Any, Literal, TypeAlias

import anyio
from anyio.abc import ByteReceiveStream
from mcp.server import MCPServer
from mcp.server.mcpserver.exceptions import ToolError
from mcp.types import ToolAnnotations

from sar_compiler.agent.call_limits import CallLimits
from sar_compiler.checks.configuration import project_paths
from sar_compiler.commands import FINDINGS, OK, RULE_FAILED
from sar_compiler.errors import SarError
from sar_compiler.resources import find, shipped_root
from sar_compiler.tree.content import real_path
from sar_compiler.tree.display_text import escape_to_one_line

_INSTRUCTIONS = (
    "Behaviour trees for robots, in YAML or XML. List the tags with `nodes`, write a tree file, `validate` it until it has "
    "no errors, `verify` its properties in all possible runs, and `propose` it. Only a person can approve a tree."
)
ToolAnswer: TypeAlias = dict[str, Any]
Facts: TypeAlias = dict[str, str | int | float | bool]


_AT_A_TIME = 2
"""The maximum number of calls that run at the same time; further calls wait."""
_MOST_CALLS = 50
"""The maximum number of calls that run or wait; further calls are refused."""
_MOST_OUTPUT_BYTES = 16 * 2**20
_SHOWN = 60


class ToolAccess:
    """The files, time and memory that the tools may use, and the command that they run.

    Args:
        roots: The folders that the tools may read, with links resolved. Relative paths begin at the first folder.
        limit_sec: The time limit of a call, in seconds.
        memory_bytes: The maximum address space of a call.
        command: The command that starts `sar-compile`.
        vocabulary: The options of `sar-compile` about nodes and palettes.
        includes: The options of `sar-compile` about folders to include from.
        named: The files and folders that these options name.
    """

    def __init__(
        self,
        roots: Sequence[Path],
        limit_sec: float,
        memory_bytes: int,
        command: Sequence[str],
        *,
        vocabulary: Sequence[str] = (),
        includes: Sequence[str] = (),
        named: Sequence[Path] = (),
    ) -> None:
        self._roots, self._limit_sec, self._memory_bytes, self._command = (
            roots,
            limit_sec,
            memory_bytes,
            command,
        )
        self.vocabulary, self.includes = vocabulary, includes
        self._said = f"the folders that the tools may read: {', '.join(map(str, roots))}"
        shipped = [shipped_root() / kind for kind in ("trees", "config")]
        places = [*roots, *map(real_path, named), *shipped, *project_paths([*roots, shipped[0]])]
        self._environment = CallLimits((*map(str, places),), self._said, memory_bytes).environment()
        self._turns, self._calls = anyio.Semaphore(_AT_A_TIME), 0

    def path(self, name: str) -> str:
        """Return a file's path relative to the first permitted folder, or the unchanged name of a shipped tree.

        The process of the call is confined to the folders as well, in case the file changes after this check.

        Raises:
            ToolError: If the path is a folder, is outside the folders that the tools may read, or is invalid.
        """
        try:
            place = real_path(self._roots[0] / name)
            if not place.exists() and find("trees", name, ".xml") != Path(name):
                return name
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise ToolError(f"invalid file name '{escape_to_one_line(name[:_SHOWN])}': {reason}") from None
        if not any(place.is_relative_to(root) for root in self._roots):
            raise ToolError(f"'{name}' is outside {self._said}")
        if place.is_dir():
            raise ToolError(f"'{name}' is a folder. Name a file")
        return os.path.relpath(place, self._roots[0])

    async def run(self, command: str, options: Sequence[str], *words: str) -> tuple[int, str, str]:
        """Run `sar-compile`, and return its exit status, its standard output and its standard error.

        At most two calls run at the same time, and further calls wait. The time limit of a call starts when
        the call stops waiting.

        Raises:
            ToolError: If too many calls wait, the call exceeds a limit, or its arguments are invalid.
        """
        if self._calls >= _MOST_CALLS:
            raise ToolError(f"{self._calls} calls are still running. Call again later")
        self._calls += 1
        try:
            async with self._turns:
                status, output, said = await self._call(command, [*options, "--", *words])
        except (OSError, ValueError) as error:  # too many words, or a zero byte in one
            raise ToolError(f"{command} was called with invalid arguments: {error}") from None
        finally:
            self._calls -= 1
        said = said.rstrip()
        if status < 0:
            memory = f"The server's option --memory limits it to {self._memory_bytes // 2**20} MiB"
            raise ToolError(f"{command} was ended by signal {-status}. {memory}")
        if status not in (OK, FINDINGS, RULE_FAILED):
            raise ToolError(said or f"sar-compile {command} has ended with status {status}")
        return status, output, said

    async def _call(self, command: str, words: Sequence[str]) -> tuple[int, str, str]:
        is_too_large = False

        async def read(stream: ByteReceiveStream, into: bytearray) -> None:
            nonlocal is_too_large
            async for part in stream:
                into += part
                if len(into) > _MOST_OUTPUT_BYTES:
                    is_too_large = True
                    process.kill()
                    return

        with anyio.move_on_after(self._limit_sec):
            async with await anyio.open_process(
                [*self._command, command, *words],
                stdin=DEVNULL,
                cwd=self._roots[0],
                env=self._environment,
            ) as process:
                output, said = bytearray(), bytearray()
                assert process.stdout is not None and process.stderr is not None  # noqa: S101, PT018 - pipes
                async with anyio.create_task_group() as readers:
                    readers.start_soon(read, process.stdout, output)
                    readers.start_soon(read, process.stderr, said)
                status = await process.wait()
            if is_too_large:
                most = f"{_MOST_OUTPUT_BYTES // 2**20} MiB"
                raise ToolError(f"the result of {command} is larger than {most}. Request less")
            return status, output.decode(errors="replace"), said.decode(errors="replace")
        raise ToolError(f"{command} was aborted after {self._limit_sec:g} s, the time limit of a call")


def find_roots(given: Sequence[Path]) -> list[Path]:
    """Return the folders that tools may read, with symbolic links resolved.

    The default is the current folder.

    Raises:
        SarError: If a path is not a folder, or the current folder is the root or the user's home folder.
    """
    for root in given:
        if not root.is_dir():
            raise SarError(f"--root {root} is not a folder")
    here = real_path(Path.cwd())
    if not given and here in (Path("/"), real_path(Path.home())):
        raise SarError(
            f"without --root, the tools could read all files below {here}. Name the folder of the trees with --root FOLDER"
        )
    return [real_path(each) for each in given] or [here]


class AgentTools:
    """The tools that an agent can call.

    The agent sees the methods' arguments and docstrings as descriptions.

    Args:
        access: The permissions of the tools.
    """

    def __init__(self, access: ToolAccess) -> None:
        self._access = access
        self._vocabulary = list(access.vocabulary)
        self._project = [*access.vocabulary, *access.includes]

    async def nodes(self, tag: str | None = None) -> ToolAnswer:
        """List all nodes that trees can use, or describe one node with its attributes and possible outcomes."""
        return await self._data("nodes", self._vocabulary, *([] if tag is None else [tag]))

    async def validate(self, file: str) -> ToolAnswer:
        """Return a tree file's findings as `output`, and its text with all suggestions applied as `fixed`."""
        path = self._access.path(file)
        answer = await self._data("validate", self._project, path)
        fixed = None
        if any(finding["suggestion"] for finding in answer["output"] or ()):
            _, fixed, _ = await self._access.run("validate", [*self._project, "--print-fixed"], path)
        return {**answer, "fixed": fixed}

    async def explain(self, code: str) -> ToolAnswer:
        """Explain a kind of finding. Show an example that causes this finding, and a corrected example."""
        return _tool_answer(*await self._access.run("explain", [], code))

    async def simulate(
        self,
        file: str,
        scenario: str | None = None,
        until: str | None = None,
        ticks: int | None = None,
        seed: int = 0,
    ) -> ToolAnswer:
        """Tick a tree without a robot, and return the events of each tick.

        The leaves return their default outcomes, or the outcomes in a scenario file. The simulation ends when the root
        ends, after `ticks` ticks, or when the script `until`, such as 'tick >= 3', is true.
        """
        given = _options(scenario=self._optional(scenario), until=until, ticks=ticks, seed=seed)
        return await self._data("simulate", [*self._project, *given], self._access.path(file))

    async def verify(
        self,
        file: str,
        properties: str | None = None,
        against: str | None = None,
        facts: Facts | None = None,
        max_states: int | None = None,
    ) -> ToolAnswer:
        """Verify that all possible runs of a tree end, raise no error, and satisfy the properties in a file.

        Counterexamples are listed tick by tick. With `against`, the results are compared with those of another tree.
        """
        given = [
            *_options(
                properties=self._optional(properties), against=self._optional(against), max_states=max_states
            ),
            *_facts(facts),
        ]
        return await self._data("verify", [*self._project, *given], self._access.path(file))

    async def predict(
        self, file: str, properties: str | None = None, facts: Facts | None = None
    ) -> ToolAnswer:
        """Compute the success probability and duration of a tree from probabilities and times in a property file."""
        given = [*_options(properties=self._optional(properties)), *_facts(facts)]
        return await self._data("predict", [*self._project, *given], self._access.path(file))

    async def diff(self, old: str, new: str) -> ToolAnswer:
        """List the differences between two tree files."""
        return await self._data("diff", [], self._access.path(old), self._access.path(new))

    async def convert(self, file: str, to: Literal["xml", "yaml", "btcpp"]) -> ToolAnswer:
        """Convert a tree file to another format; btcpp is XML for BehaviorTree.CPP 4 and Groot2."""
        return _tool_answer(
            *await self._access.run("convert", [*self._project, f"--to={to}"], self._access.path(file))
        )

    async def propose(
        self, file: str, properties: str | None = None, params: str | None = None, tree: str | None = None
    ) -> ToolAnswer:
        """Return a tree's findings and proofs, a digest of its files, and the command that approves the tree.

        `tree` is the ID of the tree in the file, and `params` the parameter file. Show the result to a person, who
        decides. This call approves nothing.
        """
        named = {"properties": self._optional(properties), "params": self._optional(params)}
        given = ["--propose", *_options(tree=tree, **named)]
        return _tool_answer(
            *await self._access.run("approve", [*self._project, *given], self._access.path(file)),
            is_json=True,
        )

    def _optional(self, name: str | None) -> str | None:
        return None if name is None else self._access.path(name)

    async def _data(self, command: str, options: Sequence[str], *words: str) -> ToolAnswer:
        return _tool_answer(
            *await self._access.run(command, [*options, "--format=json"], *words), is_json=True
        )


def _tool_answer(status: int, output: str, notes: str, *, is_json: bool = False) -> ToolAnswer:
    """Return the result of a tool: whether the command succeeded, its output, and further messages such as findings."""
    return {"ok": status == OK, "output": json.loads(output or "null") if is_json else output, "notes": notes}


def _options(**given: object) -> list[str]:
    return [f"--{name.replace('_', '-')}={value}" for name, value in given.items() if value is not None]


def _facts(facts: Facts | None) -> list[str]:
    return [
        f"--set={name}={str(value).lower() if isinstance(value, bool) else value}"
        for name, value in (facts or {}).items()
    ]


def agent_server(version: str, access: ToolAccess) -> MCPServer:
    """Create the server that offers the tools."""
    tools = AgentTools(access)
    server = MCPServer("sar_compiler", instructions=_INSTRUCTIONS, version=version, log_level="WARNING")
    for tool in (
        tools.nodes,
        tools.validate,
        tools.explain,
        tools.simulate,
        tools.verify,
        tools.predict,
        tools.diff,
        tools.convert,
        tools.propose,
    ):
        server.add_tool(tool, annotations=ToolAnnotations(read_only_hint=True, open_world_hint=False))
    return server
