"""A page opened in headless Chromium."""

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

DESKTOP, PHONE = (1400, 900), (390, 844)
# Contrast of each text with what is behind it, by WCAG 2: `name: ratio` of those below 4.5.
CONTRAST = """() => {
  const parse = (text) => (text.match(/[0-9.]+/g) || []).map(Number);
  const light = (rgb) => rgb.slice(0, 3).map((c) => c / 255)
    .map((c) => (c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, n) => sum + c * [0.2126, 0.7152, 0.0722][n], 0);
  const behind = (element) => {
    for (let e = element; e; e = e.parentElement) {
      const rgba = parse(getComputedStyle(e).backgroundColor);
      if (rgba.length === 3 || rgba[3] === 1) return rgba;
    }
    return [255, 255, 255];
  };
  const faint = [];
  for (const e of document.querySelectorAll("body *")) {
    const isText = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!isText || !e.getClientRects().length || e.closest("script, style")) continue;
    const style = getComputedStyle(e);
    if (style.visibility === "hidden" || style.opacity === "0") continue;
    const color = parse(e instanceof SVGElement ? style.fill : style.color);
    const [high, low] = [light(color), light(behind(e))].sort((a, b) => b - a);
    const ratio = (high + 0.05) / (low + 0.05);
    if (ratio < 4.5) faint.push(`${e.tagName} ${e.textContent.trim()}: ${ratio.toFixed(2)}`);
  }
  return faint;
}"""


@contextmanager
def started_chromium() -> Iterator[Browser]:
    """Start Chromium, or skip the test where there is none."""
    names = ("chromium", "chromium-browser", "google-chrome")
    program = next((path for name in names if (path := shutil.which(name))), None)
    if program is None:
        pytest.skip("no Chromium: apt-get install chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield browser
        browser.close()


class OpenPage:
    """A report in a window, with what it complained of and asked for."""

    def __init__(self, browser: Browser, path: Path, size_px: tuple[int, int]) -> None:
        width, height = size_px
        is_phone = size_px == PHONE
        self._context = browser.new_context(
            viewport={"width": width, "height": height},
            is_mobile=is_phone,
            has_touch=is_phone,
        )
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page: Page = self._context.new_page()
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url[:5]))
        self.page.goto(path.as_uri())
        self.wait_for("document.documentElement.dataset.plots === 'drawn'")

    def __enter__(self) -> "OpenPage":
        return self

    def __exit__(self, *error: object) -> None:
        self._context.close()

    def value(self, script: str) -> object:
        """Return the value of an expression."""
        return self.page.evaluate(script)

    def wait_for(self, condition: str, seconds: float = 10.0) -> None:
        """Wait until an expression is true; Playwright's own waiting is against the page's policy."""
        end_s = time.monotonic() + seconds
        while not self.value(condition):
            assert time.monotonic() < end_s, condition
            self.page.wait_for_timeout(20)
