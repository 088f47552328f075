"""Debian's chromium, driven by selenium; a test that needs it is skipped where there is none, with the reason."""

import base64
import functools
import os
import shutil
import time
from contextlib import contextmanager

import pytest

from tests.waiting import SILENCE_SEC

# How often it is looked whether something has come.
_LOOK_SEC = 0.02

CHROMIUM, DRIVER = "chromium", "chromedriver"


@contextmanager
def open_browser(*switches):
    """Open a browser without a window, with further switches."""
    chromium, driver = shutil.which(CHROMIUM), shutil.which(DRIVER)
    if not (chromium and driver):
        pytest.skip("there is no chromium with its driver here (apt install chromium chromium-driver)")
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed (extra dev)")
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in ("--headless=new", "--disable-gpu", "--disable-dev-shm-usage", *switches):
        options.add_argument(argument)
    if os.geteuid() == 0:  # where its own fence cannot be set up
        options.add_argument("--no-sandbox")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    opened = webdriver.Chrome(options=options, service=Service(driver))
    try:
        yield Browser(opened)
    finally:
        opened.quit()


class Browser:
    """A page as people see it: what is written where, and what can be pressed."""

    def __init__(self, driver):
        self.driver = driver
        self._allowed: tuple[str, ...] = ()

    def forget(self):
        """Leave the page that is open, with what was complained of."""
        self.driver.get("about:blank")
        self.driver.get_log("browser")
        self._allowed = ()
        self.size(1400, 900)
        self.touch(is_touched=False)

    def size(self, width, height, *, dark=False, media=""):
        """Have a window of some size, in light or in dark, or what comes out of a printer."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": media, "features": scheme})

    def touch(self, *, is_touched):
        """Have a screen that is touched, or a mouse."""
        self.driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": is_touched})

    def open(self, url, within_sec=SILENCE_SEC):
        """Open a page, and wait until it shows what the server had to say."""
        # Where only what follows the # is another, this would be the same page.
        self.driver.get("about:blank")
        self.driver.get(url)
        is_told = functools.partial(self.js, "return document.body.classList.contains('ready')")
        self.wait(is_told, "a page that is told", within_sec)
        return self

    def js(self, script, *arguments):
        return self.driver.execute_script(script, *arguments)

    def text(self, selector):
        """Return what is written in an element; empty where there is none."""
        return self.js("return document.querySelector(arguments[0])?.textContent ?? ''", selector)

    def click(self, selector):
        """Click an element; one that is drawn anew just then is looked for again."""
        self.wait(lambda: self._clicked(selector), f"a click on {selector}")

    def _clicked(self, selector):
        from selenium.common.exceptions import StaleElementReferenceException

        try:
            self.driver.find_element("css selector", selector).click()
        except StaleElementReferenceException:
            return False
        return True

    def pdf(self):
        """Print the page, and return the file. A browser under load refuses that now and then, and is asked again."""
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
        """Return the rows of the tree that are in sight, as they are read to blind people."""
        return self.js(
            "return [...document.querySelectorAll('#tree .row')].map((row) => row.getAttribute('aria-label'))"
        )

    def wait(self, wanted, what, within_sec=SILENCE_SEC):
        """Wait until something is so; fail with what is on the page if it never is."""
        end = time.monotonic() + within_sec
        while not wanted():
            assert time.monotonic() < end, (
                f"{what} did not come:\n{self.text('body')}\n{self.driver.get_log('browser')}"
            )
            # The browser is to get on with it, and not to be asked all the time.
            time.sleep(_LOOK_SEC)

    def wait_for(self, selector, text, within_sec=SILENCE_SEC):
        """Wait until a text is written in an element."""
        self.wait(lambda: text in self.text(selector), f"'{text}' in {selector}", within_sec)
        return self

    def allow(self, *complaints):
        """Expect complaints with some text in them."""
        self._allowed = complaints

    def require_no_complaint(self):
        """Fail if the browser has complained of the page: an error of its scripts, something refused."""
        lines = [entry["message"] for entry in self.driver.get_log("browser")]
        assert [line for line in lines if not any(text in line for text in self._allowed)] == []
