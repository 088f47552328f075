"""The forms of reports by the endings of their files, without imports of their modules, for the help of commands."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple


class ReportForm(NamedTuple):
    """A form of a report.

    Attributes:
        function: The import path of the function that returns the report, imported when one is written.
        is_of_the_world: Whether it is in world coordinates.
        libraries: Further required libraries.
        use: The purpose that the help states.
    """

    function: str
    is_of_the_world: bool = False
    libraries: Sequence[str] = ()
    use: str = ""


_EXCHANGE = "sar_compiler.reports.report_exchange"
FORMS: Mapping[str, ReportForm] = {
    ".html": ReportForm(
        "sar_compiler.reports.report_html:html_report", libraries=["jinja2"], use="to print and pass on"
    ),
    ".json": ReportForm("sar_compiler.reports.mission_report:json_report"),
    ".geojson": ReportForm(f"{_EXCHANGE}:geojson_report", is_of_the_world=True, libraries=["geojson"]),
    ".kml": ReportForm(f"{_EXCHANGE}:kml_report", is_of_the_world=True),
    ".cot": ReportForm(f"{_EXCHANGE}:cot_report", is_of_the_world=True),
    ".cap": ReportForm(f"{_EXCHANGE}:cap_report", is_of_the_world=True, libraries=["cap_tools", "xsdata"]),
}
"""The forms of reports by the endings of their files."""


def describe_forms() -> str:
    """Return the description of the forms for the help of a command."""
    here, world = (
        ", ".join(
            f"{ending} {form.use}".rstrip()
            for ending, form in FORMS.items()
            if form.is_of_the_world is is_of_the_world
        )
        for is_of_the_world in (False, True)
    )
    return f"in the format of the file's ending: {here}, or in world coordinates {world}"
