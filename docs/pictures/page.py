"""Take the picture of a mission's page: `python docs/pictures/page.py` in the project's folder, where ROS 2, selenium and chromium with its driver are.

A mission runs in the simulator with its page; when the robot is near the last zone, `page.png` and `page_narrow.png` beside this file are what
a browser shows of it, in a wide window and on a telephone.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.support.ui import WebDriverWait

COMMAND = ("trees/search_and_rescue.xml", "--sim", "--speed", "5", "--view", "web", "--web-port", "0")
SIZES = {"page": (1280, 800), "page_narrow": (400, 860)}
NEAR_M = 3.0
"""To the zone that the robot drives to, when the pictures are taken."""
PATIENCE_SEC = 120.0
"""For the start of the mission, and for most of it: 80 simulated seconds, five times as fast."""


@contextmanager
def mission() -> Iterator[str]:
    """Run a mission; yield the address of its page."""
    command = [Path(sys.executable).with_name("sar-run"), *COMMAND]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as running:  # noqa: S603 - our own command
        assert running.stderr  # noqa: S101 - it is a pipe
        try:
            said: list[str] = []
            for line in running.stderr:
                said.append(line)
                if found := re.search(r"http://127\.0\.0\.1:\S+", line):
                    break
            else:
                sys.exit(f"{''.join(said)}The mission has no page.")
            # All is read to the end, or the mission would wait for a reader.
            threading.Thread(target=running.stderr.read, daemon=True).start()
            yield found[0]
        finally:
            running.send_signal(signal.SIGINT)


@contextmanager
def browser() -> Iterator[webdriver.Chrome]:
    """Open a browser without a window."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for argument in ("--headless=new", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars"):
        options.add_argument(argument)
    if os.geteuid() == 0:  # where its own fence cannot be set up
        options.add_argument("--no-sandbox")
    opened = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver") or ""))
    try:
        yield opened
    finally:
        opened.quit()


def _is_far_on(page: webdriver.Chrome) -> bool:
    """Return whether the robot is near the last zone."""
    left = re.search(r"([\d.]+) m left", page.find_element("id", "now").text)
    return (
        "zones visited 3 of 4" in page.find_element("id", "progress").text
        and bool(left)
        and float(left[1]) < NEAR_M
    )


def main() -> None:
    """Take the pictures."""
    with mission() as address, browser() as page:
        page.get(address)
        WebDriverWait(page, PATIENCE_SEC, poll_frequency=0.2).until(
            _is_far_on, "no drive to the last zone was seen"
        )
        for name, (width, height) in SIZES.items():
            size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
            page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
            page.save_screenshot(str(Path(__file__).with_name(f"{name}.png")))


if __name__ == "__main__":
    main()
