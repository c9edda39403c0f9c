"""How long the explorer takes from a move of a slider to its redraw: python benchmarks/explorer.py

The slider of the slope is dragged at 60 moves a second in a browser on this machine. Beside the whole time stand its
parts: until the question leaves (the one before it is still open), until its answer is there, and until it is painted.
"""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
import time
from typing import Any

import numpy as np
from playwright.sync_api import Page, sync_playwright

MOVES, PER_SECOND = 240, 60.0
#: Times in ms at the median and at 95 %, that are aimed at.
TARGETS = {"flows": (20.0, 50.0), "curve": (30.0, 80.0)}
_TIMES = """() => Object.fromEntries(['flows', 'curve'].map((name) => [name, {
  redraw: performance.getEntriesByName(`${name}-redraw`).map((one) => [one.startTime, one.duration]),
  asked: performance.getEntriesByType('resource').filter((one) => one.name.includes(`/ask/${name}?`))
    .map((one) => [one.startTime, one.responseEnd - one.startTime, one.transferSize]),
}]))"""


def main() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "chuteflow", "explore", "--no-browser", "--port", str(port)]
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        with sync_playwright() as playwright:
            chromium = shutil.which("chromium") or shutil.which("google-chrome")
            browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1400, "height": 1000})
            for name, times in measured(page, f"http://127.0.0.1:{port}").items():
                told(name, times)
            browser.close()
    finally:
        server.terminate()
        server.wait()


def measured(page: Page, address: str) -> dict[str, Any]:
    """Times of all redraws during one drag, once everything is loaded and compiled."""
    for attempt in range(100):
        try:
            page.goto(address)
            break
        except Exception:  # the server may not listen yet
            if attempt == 99:
                raise
            time.sleep(0.2)
    page.locator("#count").filter(has_text="flux").wait_for(timeout=120_000)
    page.wait_for_timeout(4000)
    box = page.locator("#slope-slider").bounding_box()
    assert box is not None
    up, left, right = box["y"] + box["height"] / 2, box["x"] + 0.36 * box["width"], box["x"] + 0.42 * box["width"]
    page.evaluate("performance.clearMeasures(); performance.clearResourceTimings()")
    page.evaluate("performance.setResourceTimingBufferSize(9999)")
    page.mouse.move(left, up)
    page.mouse.down()
    began = time.perf_counter()
    for i in range(MOVES):
        place = abs(2.0 * i / MOVES - 1.0)
        page.mouse.move(right + (left - right) * place, up)
        time.sleep(max(0.0, began + (i + 1) / PER_SECOND - time.perf_counter()))
    page.mouse.up()
    page.wait_for_timeout(500)
    return page.evaluate(_TIMES)


def told(name: str, times: dict[str, Any]) -> None:
    redraw, asked = np.array(times["redraw"]), np.array(times["asked"])
    middle, late = np.percentile(redraw[:, 1], [50, 95])
    aims = TARGETS[name]
    print(f"{name}: {len(redraw)} redraws, {middle:.0f} ms at the median (aim {aims[0]:.0f}), ", end="")
    print(f"{late:.0f} ms at 95 % (aim {aims[1]:.0f})")
    ends = asked[:, 0] + asked[:, 1]
    before, after = [], []
    for start, duration in redraw:
        # The answer that this redraw shows is the last that was there before it was painted.
        known = np.flatnonzero((ends <= start + duration) & (asked[:, 0] >= start))
        if len(known):
            before.append(asked[known[-1], 0] - start)
            after.append(start + duration - ends[known[-1]])
    parts = [np.median(part) for part in (before, asked[:, 1], after)]
    print("   of which until asked {:.0f} ms, answered {:.0f} ms, painted {:.0f} ms (medians)".format(*parts))
    print(f"   answers of {np.median(asked[:, 2]) / 1e3:.1f} kB")


if __name__ == "__main__":
    main()
