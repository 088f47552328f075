"""The run extensions that the command line requests.

Only the dependencies of these extensions are imported.
"""

from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

from sar_compiler.errors import SarError
from sar_compiler.parts import is_part_installed

if TYPE_CHECKING:
    from sar_compiler.execution.run_setup import MakeExtension


def requested_extensions(options: Namespace) -> "Iterator[MakeExtension]":
    """Import the dependencies of the extensions that the command line requests, and yield the constructors.

    Raises:
        ImportError: If a library is not installed.
    """
    if is_part_installed("reports"):
        from sar_compiler.reports.run_report import FailureCause

        yield lambda run: FailureCause() if run.journal.is_kept else None
    if options.properties:
        from sar_compiler.execution.run_watch import PropertyWatch

        yield PropertyWatch
    if options.view == "web":
        from sar_compiler.web.run_page import RunPage

        yield partial(RunPage, port=options.web_port, opens=options.open)
    if options.view == "text":
        from sar_compiler.execution.run_view import run_view

        yield run_view()
    if options.report:
        from sar_compiler.reports.run_report import RunReport

        yield lambda run: RunReport(
            options.report, run.parameters.georeference, run.journal.earlier(), run.journal.path.parent
        )
    if (file := options.record) is not None:
        from sar_compiler.ros.mission_recording import MissionRecording

        yield prefix_errors("--record")(lambda run: MissionRecording(run.node, file))
    if options.publish:
        from sar_compiler.ros.mission_publisher import MissionPublisher

        yield lambda run: MissionPublisher(run.node)
    if (port := options.groot2) is not None:
        from sar_compiler.groot2.groot2_extension import Groot2Extension

        yield lambda _: Groot2Extension(port)
    if options.guardian is not False:
        from sar_compiler.execution.extensions import guardian_of

        yield guardian_of


@contextmanager
def prefix_errors(option: str) -> Iterator[None]:
    """Prefix errors raised in the block with the option's name.

    Raises:
        SarError: With the prefix, if the block raises a `SarError`.
    """
    try:
        yield
    except SarError as error:
        raise SarError(f"{option}: {error}") from error
