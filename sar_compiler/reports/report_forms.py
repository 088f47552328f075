"""Defines the formats of reports without importing their modules, so that help texts are fast."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple


class ReportForm(NamedTuple):
    """A format in which a report can be written.

    Attributes:
        function: The import path of the function that returns the report; imported when a report is written.
        is_of_the_world: Whether the report is in world coordinates.
        libraries: Further libraries that the format requires.
        use: The purpose of the format, as stated in the help of commands; may be empty.
    """

    function: str
    is_of_the_world: bool = False
    libraries: Sequence[str] = ()
    use: str = ""


_EXCHANGE = "sar_compiler.reports.report_exchange"
FORMS: Mapping[str, ReportForm] = {
    ".html": ReportForm(
        "sar_compiler.reports.report_html:html_report", libraries=["jinja2"], use="to print and forward"
    ),
    ".json": ReportForm("sar_compiler.reports.mission_report:json_report"),
    ".geojson": ReportForm(f"{_EXCHANGE}:geojson_report", is_of_the_world=True, libraries=["geojson"]),
    ".kml": ReportForm(f"{_EXCHANGE}:kml_report", is_of_the_world=True),
    ".cot": ReportForm(f"{_EXCHANGE}:cot_report", is_of_the_world=True),
    ".cap": ReportForm(f"{_EXCHANGE}:cap_report", is_of_the_world=True, libraries=["cap_tools", "xsdata"]),
}
"""The formats of reports, by file name extension."""


def describe_forms() -> str:
    """Return a description of all report formats, for the help of a command."""
    here, world = (
        ", ".join(
            f"{ending} {form.use}".rstrip()
            for ending, form in FORMS.items()
            if form.is_of_the_world is is_of_the_world
        )
        for is_of_the_world in (False, True)
    )
    return f"in the format that the file name extension selects: {here}, or {world} in world coordinates"
