"""Debian's chromium, driven by selenium; a test that needs it is skipped if it is not installed."""

import base64
import functools
import os
import shutil
import time
from contextlib import contextmanager

import pytest

from tests.waiting import SILENCE_SEC

# The period of checks while waiting.
_LOOK_SEC = 0.02

CHROMIUM, DRIVER = "chromium", "chromedriver"


@contextmanager
def open_browser(*switches):
    """Open a headless browser with further command line switches."""
    chromium, driver = shutil.which(CHROMIUM), shutil.which(DRIVER)
    if not (chromium and driver):
        pytest.skip("there is no chromium with its driver here (apt install chromium chromium-driver)")
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed (extra dev)")
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in ("--headless=new", "--disable-gpu", "--disable-dev-shm-usage", *switches):
        options.add_argument(argument)
    if os.geteuid() == 0:  # whose browser cannot set up its sandbox
        options.add_argument("--no-sandbox")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    opened = webdriver.Chrome(options=options, service=Service(driver))
    try:
        yield Browser(opened)
    finally:
        opened.quit()


class Browser:
    """The interface to a page for tests: its texts, clicks and keys."""

    def __init__(self, driver):
        self.driver = driver
        self._allowed: tuple[str, ...] = ()

    def forget(self):
        """Leave the open page, and clear the browser's log and settings."""
        self.driver.get("about:blank")
        self.driver.get_log("browser")
        self._allowed = ()
        self.size(1400, 900)
        self.touch(is_touched=False)

    def size(self, width, height, *, dark=False, media=""):
        """Set the size of the window, light or dark mode, and the media type."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": media, "features": scheme})

    def touch(self, *, is_touched):
        """Emulate a touch screen or a mouse."""
        self.driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": is_touched})

    def open(self, url, within_sec=SILENCE_SEC):
        """Open a page, and wait until it shows the state from the server."""
        # Without about:blank, an address that differs only after the # would not be loaded.
        self.driver.get("about:blank")
        self.driver.get(url)
        is_told = functools.partial(self.js, "return document.body.classList.contains('ready')")
        self.wait(is_told, "a page that is told", within_sec)
        return self

    def js(self, script, *arguments):
        return self.driver.execute_script(script, *arguments)

    def text(self, selector):
        """Return the text of an element, empty if there is none."""
        return self.js("return document.querySelector(arguments[0])?.textContent ?? ''", selector)

    def click(self, selector):
        """Click an element; search it again if it is redrawn at that time."""
        self.wait(lambda: self._clicked(selector), f"a click on {selector}")

    def _clicked(self, selector):
        from selenium.common.exceptions import StaleElementReferenceException

        try:
            self.driver.find_element("css selector", selector).click()
        except StaleElementReferenceException:
            return False
        return True

    def pdf(self):
        """Print the page, and return the file. Failures of a browser under load are retried."""
        from selenium.common.exceptions import WebDriverException

        printed = []

        def is_printed():
            try:
                result = self.driver.execute_cdp_cmd("Page.printToPDF", {"preferCSSPageSize": True})
            except WebDriverException as error:
                if "Printing failed" not in str(error):
                    raise
            else:
                printed.append(base64.b64decode(result["data"]))
            return bool(printed)

        self.wait(is_printed, "a print of the page")
        return printed[0]

    def type(self, selector, *keys):
        """Press keys in an element."""
        self.driver.find_element("css selector", selector).send_keys(*keys)

    def rows(self):
        """Return the labels of the tree's visible rows for screen readers."""
        return self.js(
            "return [...document.querySelectorAll('#tree .row')].map((row) => row.getAttribute('aria-label'))"
        )

    def wait(self, wanted, what, within_sec=SILENCE_SEC):
        """Wait until a condition holds; fail with the text of the page after a timeout."""
        end = time.monotonic() + within_sec
        while not wanted():
            assert time.monotonic() < end, (
                f"{what} did not come:\n{self.text('body')}\n{self.driver.get_log('browser')}"
            )
            # Constant requests would slow the browser down.
            time.sleep(_LOOK_SEC)

    def wait_for(self, selector, text, within_sec=SILENCE_SEC):
        """Wait until an element contains a text."""
        self.wait(lambda: text in self.text(selector), f"'{text}' in {selector}", within_sec)
        return self

    def allow(self, *complaints):
        """Allow browser errors that contain one of these texts."""
        self._allowed = complaints

    def require_no_complaint(self):
        """Fail if the browser has logged an error of the page, such as a script error or a refused request."""
        lines = [entry["message"] for entry in self.driver.get_log("browser")]
        assert [line for line in lines if not any(text in line for text in self._allowed)] == []
