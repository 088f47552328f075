"""The forms of reports by the endings of their files, with nothing imported that makes one: the help of commands names them."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple


class ReportForm(NamedTuple):
    """A form of a report.

    Attributes:
        function: The import path of what returns the report of a mission, imported when one is written.
        is_of_the_world: Whether it is in coordinates of the world.
        libraries: What it takes besides.
        use: What the help says that it is for.
    """

    function: str
    is_of_the_world: bool = False
    libraries: Sequence[str] = ()
    use: str = ""


_EXCHANGE = "sar_compiler.reports.report_exchange"
FORMS: Mapping[str, ReportForm] = {
    ".html": ReportForm(
        "sar_compiler.reports.report_html:html_report", libraries=["jinja2"], use="to print and hand on"
    ),
    ".json": ReportForm("sar_compiler.reports.mission_report:json_report"),
    ".geojson": ReportForm(f"{_EXCHANGE}:geojson_report", is_of_the_world=True, libraries=["geojson"]),
    ".kml": ReportForm(f"{_EXCHANGE}:kml_report", is_of_the_world=True),
    ".cot": ReportForm(f"{_EXCHANGE}:cot_report", is_of_the_world=True),
    ".cap": ReportForm(f"{_EXCHANGE}:cap_report", is_of_the_world=True, libraries=["cap_tools", "xsdata"]),
}
"""The forms of reports by the endings of their files."""


def forms_in_words() -> str:
    """Return what the help of a command says of the forms."""
    here, world = (
        ", ".join(
            f"{ending} {form.use}".rstrip()
            for ending, form in FORMS.items()
            if form.is_of_the_world is is_of_the_world
        )
        for is_of_the_world in (False, True)
    )
    return f"in the form of the file's ending: {here}, or in the world's coordinates {world}"
