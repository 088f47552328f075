"""Checks and reports of `ros2 doctor`, by their published interface."""


class DoctorCheck:
    """A check that finds problems."""


class DoctorReport:
    """A report about the system."""


class Report:
    """The lines of a report."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.items: list[tuple[str, str]] = []

    def add_to_report(self, item_name: str, item_info: str) -> None:
        self.items.append((item_name, item_info))


class Result:
    """The number of errors and warnings."""

    def __init__(self) -> None:
        self.error = 0
        self.warning = 0

    def add_error(self) -> None:
        self.error += 1

    def add_warning(self) -> None:
        self.warning += 1
