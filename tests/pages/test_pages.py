# SPDX-License-Identifier: Apache-2.0
"""Opens pages of the program in headless Chromium, narrow and wide, light and dark.

Needs playwright and axe-playwright-python (PyPI), Chromium (Debian: chromium), and the environment
variable BLINDCORNER_PROGRAM with the path of the program.
"""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

sync_api = pytest.importorskip("playwright.sync_api")
axe_sync = pytest.importorskip("axe_playwright_python.sync_playwright")

SCENES = Path(__file__).resolve().parents[2] / "scenes"
CHROMIUM = shutil.which("chromium")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium was not found (Debian: chromium)")


@pytest.fixture(scope="session")
def result_page(tmp_path_factory):
    """Path of result.html of the bundled capture of a wall."""
    folder = tmp_path_factory.mktemp("fit")
    subprocess.run([os.environ["BLINDCORNER_PROGRAM"], "fit", SCENES / "tmf8828_wall.json",
                    SCENES / "captures" / "tmf8828_wall.exr", "-o", folder], check=True, timeout=300)
    return folder / "result.html"


@pytest.fixture(scope="session")
def browser():
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1280])
def test_page_has_no_fault(browser, result_page, width, scheme):
    page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
    faults = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("console", lambda message: faults.append(message.text) if message.type == "error" else None)
    page.on("request", lambda request: faults.append(request.url)
            if re.match(r"(https?|wss?):", request.url) else None)
    page.goto(result_page.as_uri())
    page.wait_for_load_state("load")
    assert faults == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    violations = axe_sync.Axe().run(page).response["violations"]
    serious = [(found["id"], [node["target"] for node in found["nodes"]]) for found in violations
               if found["impact"] in ("serious", "critical")]
    page.close()
    assert serious == []


def test_result_prints_on_one_sheet(browser, result_page):
    page = browser.new_page()
    page.goto(result_page.as_uri())
    sheets = len(re.findall(rb"/Type\s*/Page\b", page.pdf(format="A4")))
    page.close()
    assert sheets == 1
