"""Draw the pictures of the documentation: python docs/make_images.py [NAME ...], some minutes for all.

Those that a page draws itself while it is built are not among them.
"""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

IMAGES = Path(__file__).parent / "images"
MEASURED = Path(__file__).parent / "measured" / "particles"
PAPER = "--slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6"
COMMANDS = {
    "three-flows": f"solve {PAPER} --flux 3",
    "curve": f"curve {PAPER}",
    "growth": f"growth {PAPER} --flux 3 --kx 0:0.02 --ky 0:0.03 --size 20x20",
    "neutral": f"neutral {PAPER} --waves across --size 16x16",
    "compared": f"compare {MEASURED}/hot01-triangular-2.csv --with lun,garzo-dufty-fourier",
    "stability-curve": f"curve {PAPER} --search-temperature 0.05:50 --points 80 --stability --samples 12",
}


def draw(name: str) -> None:
    """Draw the picture of one command."""
    command = [sys.executable, "-m", "chuteflow", *COMMANDS[name].split(), "--plot", str(IMAGES / f"{name}.png")]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def predict(name: str) -> None:
    """Draw the prediction of the page on calibration, from its measurements and by its commands."""
    page = IMAGES.parent / "calibration.md"
    text = page.read_text(encoding="utf-8")
    written = re.search(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    commands = re.findall(r"^chuteflow ((?:fit|predict) .*(?:--out|--flux) .*)$", text, re.MULTILINE)
    assert written is not None
    with TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-c", written[1]], check=True, cwd=folder)
        for command in commands:
            drawn = ["--plot", str(IMAGES.resolve() / f"{name}.png")] if command.startswith("predict") else []
            words = [sys.executable, "-m", "chuteflow", *shlex.split(command), *drawn]
            subprocess.run(words, check=True, stdout=subprocess.DEVNULL, cwd=folder)


def photograph(name: str) -> None:
    """Take a picture of the explorer in a browser, as it opens: with the chute of the paper."""
    from playwright.sync_api import expect, sync_playwright

    server = subprocess.Popen(
        [sys.executable, "-m", "chuteflow", "explore", "--port", "0", "--no-browser"],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert server.stdout is not None
    try:
        address = next(found[0] for line in server.stdout if (found := re.search(r"http://\S+", line)))
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1280, "height": 900})
            page.goto(address)
            expect(page.locator("#says")).not_to_be_empty(timeout=120_000)
            page.wait_for_load_state("networkidle", timeout=300_000)
            page.screenshot(path=IMAGES / f"{name}.png")
            browser.close()
    finally:
        server.terminate()
        server.wait()


def main() -> None:
    """Draw the pictures that are named, or all."""
    pictures: dict[str, Callable[[str], None]] = {
        **dict.fromkeys(COMMANDS, draw),
        "prediction": predict,
        "explorer": photograph,
    }
    for name in sys.argv[1:] or pictures:
        pictures[name](name)
        print(name, flush=True)


if __name__ == "__main__":
    main()
