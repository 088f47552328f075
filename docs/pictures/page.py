"""Take the pictures of a mission's pages: `python docs/pictures/page.py` in the project's folder, with ROS 2, selenium, chromium and its driver.

A mission runs in the simulator. When the robot is near the last zone, a browser takes the pictures in `PICTURES` of the mission's pages, in a
wide window and in the window of a telephone.
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

COMMAND = ("search_and_rescue_guarded", "--sim", "--speed", "5", "--view", "web", "--web-port", "0")
PICTURES = {"page": ("", 1500, 880), "page_narrow": ("", 400, 860), "page_tree": ("tree", 1280, 800)}
"""The page, and the width and height of the window in pixels, by the name of the picture."""
NEAR_M = 6.0
"""The remaining distance to the last zone at which the pictures are taken, metres."""
PATIENCE_SEC = 120.0
"""The maximum wait for the drive to the last zone, seconds. It takes about 80 simulated seconds, five times as fast as real time."""


@contextmanager
def mission() -> Iterator[str]:
    """Run a mission; yield the address of its page."""
    command = [str(Path(sys.executable).with_name("sar-run")), *COMMAND]
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
            # The pipe is read to its end, because a full pipe would block the mission.
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
    if os.geteuid() == 0:  # chromium cannot set up its sandbox as root
        options.add_argument("--no-sandbox")
    opened = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver") or ""))
    try:
        yield opened
    finally:
        opened.quit()


def _is_near_last_zone(page: webdriver.Chrome) -> bool:
    """Return whether the robot is near the last zone."""
    left = re.match(r"([\d.]+) m", page.find_element("id", "drive").text)
    return (
        "3 of 4" in page.find_element("id", "figures").text and left is not None and float(left[1]) < NEAR_M
    )


def _take(page: webdriver.Chrome, address: str, name: str) -> None:
    view, width, height = PICTURES[name]
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    start, _, token = address.partition("#")
    page.get(f"{start}{view}#{token}")
    is_ready = "return document.body.classList.contains('ready') && !document.querySelector('.stop').disabled"
    WebDriverWait(page, PATIENCE_SEC, poll_frequency=0.1).until(
        lambda _: page.execute_script(is_ready), f"the page of {name} was not ready"
    )
    page.save_screenshot(str(Path(__file__).with_name(f"{name}.png")))


def main() -> None:
    """Take the pictures."""
    with mission() as address, browser() as page:
        page.get(address)
        WebDriverWait(page, PATIENCE_SEC, poll_frequency=0.2).until(
            _is_near_last_zone, "the robot did not drive to the last zone"
        )
        for name in PICTURES:
            # A browser does not reload a page if only the part after the # changes.
            page.get("about:blank")
            _take(page, address, name)


if __name__ == "__main__":
    main()
