"""The companions of a run of `sar-run`: they keep, show, record or tell it; what they take is imported only where they are asked for."""

from argparse import Namespace
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, NamedTuple

from sar_compiler.errors import SarError
from sar_compiler.ros.companion import Companion

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.cli.run_journal import RunJournal
    from sar_compiler.cli.run_watch import RunWatch
    from sar_compiler.cli.terminal import RunOutput
    from sar_compiler.compiler import CompiledTree
    from sar_compiler.journal.journal import Journal
    from sar_compiler.missions.mission import MissionRun
    from sar_compiler.missions.order_record import OrderRecord
    from sar_compiler.monitoring.groot2_publisher import Groot2Publisher
    from sar_compiler.project import LoadedTree
    from sar_compiler.ros.engine import Engine
    from sar_compiler.ros.parameter_reader import RunParameters
    from sar_compiler.ros.signals import StopSignals


class RunSetup(NamedTuple):
    """What there is of a run before its tree is compiled.

    Attributes:
        options: The options of the command line.
        signals: The requests to stop.
        node: The run's node.
        journal: Its journal, which may be none.
        mission: The run of the mission.
        parameters: The parameters that any run has.
        loaded: The tree's file.
        values: What the node's parameters give to the tree, by their names.
        fixed_parameters: The names of those that are not set while it runs.
        output: Standard output.
        orders: Records by whom its orders are given.
        staying: What is to be called when the run has ended and ROS is taken down: who stays has its say there.
    """

    options: Namespace
    signals: "StopSignals"
    node: "Node"
    journal: "Journal"
    mission: "MissionRun"
    parameters: "RunParameters"
    loaded: "LoadedTree"
    values: Mapping[str, object]
    fixed_parameters: Collection[str]
    output: "RunOutput"
    orders: "OrderRecord"
    staying: list[Callable[[], object]]


Make = Callable[[RunSetup], Companion | None]


def companions_asked_for(options: Namespace) -> Iterator[Make]:
    """Yield for each companion that the command line asks for what makes it; what that takes is imported.

    Raises:
        ImportError: If a library is not installed.
    """
    if options.properties:
        from sar_compiler.cli.run_watch import RunWatch

        yield RunWatch
    if options.view == "web":
        from sar_compiler.cli.run_page import RunPage

        yield RunPage
    if options.view == "text":
        from sar_compiler.cli.run_view import run_view

        yield run_view()
    if options.report:
        from sar_compiler.cli.run_report import RunReport

        yield lambda run: RunReport(
            options.report, run.parameters.georeference, run.journal.earlier(), run.journal.place.parent
        )
    if (file := options.record) is not None:
        from sar_compiler.ros.mission_recording import MissionRecording

        yield errors_of("--record")(lambda run: MissionRecording(run.node, file))
    if options.publish:
        from sar_compiler.ros.mission_publisher import MissionPublisher

        yield lambda run: MissionPublisher(run.node)
    if (port := options.groot2) is not None:
        from sar_compiler.monitoring.groot2_publisher import Groot2Publisher

        yield lambda run: RunGroot2(port, run, Groot2Publisher)
    if options.guardian is not False:
        yield _guardian


def _guardian(run: RunSetup) -> Companion | None:
    """Return what guards the goals of a run, if that is asked for, or usual: a simulation dies with the run."""
    if not run.options.guardian and not (run.journal.is_kept and run.options.sim is None):
        return None
    from sar_compiler.ros.arguments import security_arguments
    from sar_compiler.ros.guardian import Guardian

    return Guardian(run.node, security_arguments(run.options.ros), run.options.supervision.signs)


@contextmanager
def errors_of(option: str) -> Iterator[None]:
    """Say of errors within it by which option they come.

    Raises:
        SarError: In place of another one.
    """
    try:
        yield
    except SarError as error:
        raise SarError(f"{option}: {error}") from error


class RunGroot2(Companion):
    """Shows a run in Groot2.

    Args:
        port: The port of this machine; the next one is used as well.
        run: The run.
        make: Makes what answers Groot2.
    """

    def __init__(self, port: int, run: RunSetup, make: "type[Groot2Publisher]") -> None:
        self._port, self._run, self._make = port, run, make
        self._publisher: Groot2Publisher | None = None

    @errors_of("--groot2")
    def begin(self, tree: "CompiledTree", engine: "Engine") -> None:
        """Answer from here on.

        Raises:
            SarError: If the port cannot be had, or the tree is too large.
        """
        self._publisher = self._make(tree, self._port)
        self._publisher.watch(engine)

    def end(self, *, has_begun: bool) -> None:  # noqa: ARG002 - it is answered from before that on
        """Answer nobody any more."""
        if self._publisher is not None:
            self._publisher.close()


class Companions:
    """Those who go along with one run.

    Args:
        run: The run.
        journal: The run's journal, which is ended last.
        makes: What makes each of the others, which may listen to it.
        stack: Ends them, the last one first, whatever becomes of the run.

    Raises:
        SarError: If one of them cannot be.
        ImportError: If a library is not installed.
    """

    def __init__(self, run: RunSetup, journal: "RunJournal", makes: Iterable[Make], stack: ExitStack) -> None:
        self._journal, self._has_begun, self._options = journal, False, run.options
        self._complain = run.node.get_logger().error
        self._companions: list[Companion] = []
        for make in (lambda _: journal, *makes):
            companion = make(run)
            if companion is None:
                continue
            self._companions.append(companion)
            stack.callback(self._end, companion)
            if type(companion).take is not Companion.take:
                run.journal.listen(companion.take)

    def begin(self, tree: "CompiledTree", engine: "Engine") -> None:
        """Let each of them begin.

        Raises:
            SarError: If one cannot.
        """
        for companion in self._companions:
            companion.begin(tree, engine)

    @property
    def how_to_see_it_again(self) -> str:
        """The line that shows a simulation again; empty for other runs, and where no journal is kept."""
        return self._journal.how_to_see_it_again

    def first_to_look_at(self) -> str:
        """Return the likeliest cause of a failure in a line; empty where none is known, or no journal is kept."""
        return self._journal.first_to_look_at()

    def begin_run(self) -> None:
        """Let the tree be ticked from here on: its journal begins, which tells the others.

        Raises:
            JournalError: If it cannot be written.
        """
        for companion in self._companions:
            companion.begin_run()
        self._has_begun = True

    def take_setup(self) -> None:
        """Tell each of them that the leaves are set up.

        Raises:
            UnfitLeavesError: If the run cannot be with these leaves.
        """
        for companion in self._companions:
            companion.take_setup()

    def conclude(self, *, is_over: bool) -> None:
        """Tell each of them that nothing is ticked any more, before the tree is stopped."""
        for companion in self._companions:
            companion.conclude(is_over=is_over)

    def watch(self) -> "RunWatch | None":
        """Return who watches the run for properties; None if nobody does."""
        if not self._options.properties:
            return None
        from sar_compiler.cli.run_watch import RunWatch

        return next(each for each in self._companions if isinstance(each, RunWatch))

    def _end(self, companion: Companion) -> None:
        try:
            companion.end(has_begun=self._has_begun)
        except Exception as error:  # noqa: BLE001 - nobody who only watches keeps others from their end
            self._complain(f"{type(companion).__name__} could not come to its end: {error!r}.")
