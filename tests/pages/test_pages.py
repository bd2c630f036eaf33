# SPDX-License-Identifier: Apache-2.0
"""Opens every kind of page that the program makes in headless Chromium, narrow and wide, light and dark.

A page has no script error and asks for nothing from elsewhere, does not scroll sideways, has no serious
fault by axe-core, is worked by keyboard alone, and shows the numbers of the files beside it. Needs
playwright and axe-playwright-python (PyPI), Chromium (Debian: chromium; or what the environment variable
BLINDCORNER_CHROMIUM names), and the environment variable BLINDCORNER_PROGRAM with the path of the program.
./bootstrap.sh pages installs all of that.
"""

import os
import re
import shutil
from urllib.parse import urlparse

import pytest

from gallery import MAKERS, WITH_LIBTORCH, Gallery, Live
from numbers_shown import NUMBERS, live_numbers

sync_api = pytest.importorskip("playwright.sync_api")
axe_sync = pytest.importorskip("axe_playwright_python.sync_playwright")

CHROMIUM = os.environ.get("BLINDCORNER_CHROMIUM") or shutil.which("chromium")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium was not found (Debian: chromium)")
WIDTHS = (390, 1280)
SCHEMES = ("light", "dark")
SETTLED = "headline => !/^(Waiting|State)/.test(document.querySelector('.headline').textContent)"


@pytest.fixture(scope="session")
def gallery(tmp_path_factory):
    pages = Gallery(tmp_path_factory.mktemp("pages"))
    yield pages
    pages.close()


@pytest.fixture(scope="session")
def live(tmp_path_factory):
    server = Live(tmp_path_factory.mktemp("live"))
    yield server
    server.close()


@pytest.fixture(scope="session")
def browser():
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


class Opened:
    """A page in the browser, and what went wrong while it was open."""

    def __init__(self, browser, address, width=1280, scheme="light"):
        # Who wants nothing to move by itself gets a page that stands still.
        self.page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme,
                                     reduced_motion="reduce")
        self.faults = []
        own = urlparse(address)
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.on("console", lambda message: self.faults.append(message.text)
                     if message.type == "error" else None)
        self.page.on("request", lambda request: self.faults.append("asks for " + request.url)
                     if urlparse(request.url)[:2] != own[:2] and not request.url.startswith("data:") else None)
        self.page.goto(address)
        self.page.wait_for_load_state("load")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.page.close()


def address_of(name, gallery, request):
    if name == "live":
        return request.getfixturevalue("live").url  # it takes processor time from when it is first asked for
    try:
        return gallery[name].as_uri()
    except RuntimeError as error:
        if name in WITH_LIBTORCH and "libtorch" in str(error):
            pytest.skip("this program is built without libtorch (Debian: libtorch-dev)")
        raise


def still(opened, name):
    """The live page waits for an answer and then for us."""
    if name == "live":
        opened.page.wait_for_function(SETTLED, timeout=60000)
        opened.page.get_by_role("button", name="Pause the pictures").press("Enter")


def serious_faults(page):
    violations = axe_sync.Axe().run(page).response["violations"]
    return [(found["id"], [node["target"] for node in found["nodes"]]) for found in violations
            if found["impact"] in ("serious", "critical")]


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", [*MAKERS, "live"])
def test_page_has_no_fault(browser, gallery, request, name, width, scheme):
    with Opened(browser, address_of(name, gallery, request), width, scheme) as opened:
        still(opened, name)
        assert opened.page.evaluate("document.documentElement.scrollWidth") <= width
        assert serious_faults(opened.page) == []
        assert opened.faults == []


# Numbers what can be worked with the keyboard, in "data-control".
MARK = """() => [...document.querySelectorAll('a[href], button, input, select, textarea, summary, [tabindex]')]
  .filter(e => e.tabIndex >= 0 && !e.disabled && e.checkVisibility({visibilityProperty: true}))
  .map((e, i) => { e.setAttribute('data-control', i); return e.outerHTML.slice(0, 120); })"""
FOCUSED = """() => {
  const e = document.activeElement, style = getComputedStyle(e), box = e.getBoundingClientRect();
  return [e.getAttribute('data-control'), style.outlineStyle !== 'none' && parseFloat(style.outlineWidth) >= 1,
          box.bottom > 0 && box.top < innerHeight];
}"""


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", [*MAKERS, "live"])
def test_keyboard_reaches_every_control(browser, gallery, request, name, width):
    with Opened(browser, address_of(name, gallery, request), width) as opened:
        page = opened.page
        still(opened, name)
        page.evaluate("document.body.tabIndex = -1; document.body.focus(); document.body.removeAttribute('tabindex')")
        controls = page.evaluate(MARK)
        reached = set()
        for _ in controls:
            page.keyboard.press("Tab")
            control, outlined, in_view = page.evaluate(FOCUSED)
            assert control is not None, "the focus went nowhere"
            assert outlined, f"no visible focus: {controls[int(control)]}"
            assert in_view, f"focus out of sight: {controls[int(control)]}"
            reached.add(int(control))
        assert [html for i, html in enumerate(controls) if i not in reached] == []
        assert nameless(page) == []
        assert opened.faults == []


def nameless(page):
    """Roles of those that have the focus at times and that a screen reader cannot name."""
    tree = page.context.new_cdp_session(page).send("Accessibility.getFullAXTree")["nodes"]
    found = []
    for node in tree:
        focusable = any(p["name"] == "focusable" and p["value"]["value"] for p in node.get("properties", []))
        role = node.get("role", {}).get("value")
        if focusable and not node.get("ignored") and role != "RootWebArea":
            if not node.get("name", {}).get("value", "").strip():
                found.append(role)
    return found


@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_are_those_of_the_files(browser, gallery, request, name):
    with Opened(browser, address_of(name, gallery, request)) as opened:
        NUMBERS[name](opened.page, gallery[name])
        assert opened.faults == []


def test_every_page_has_its_numbers_compared():
    # A scene that `init` writes is the page of `scene`, and crossvalidation that of evaluation.
    assert set(MAKERS) - set(NUMBERS) == {"init", "crossvalidation"}


def test_live_numbers_are_those_of_the_answers(browser, live):
    with Opened(browser, live.url) as opened:
        opened.page.wait_for_function(SETTLED, timeout=60000)
        live_numbers(opened.page, live.answers)


def test_a_map_is_moved_and_enlarged_by_keyboard(browser, gallery):
    with Opened(browser, gallery["fit"].as_uri()) as opened:
        place = opened.page.locator("svg.map").first
        ticks = "svg => [...svg.querySelectorAll('text.soft')].map(t => t.textContent + t.getAttribute('x')).join()"
        place.focus()
        seen = {place.evaluate(ticks)}
        for key in ("ArrowLeft", "ArrowUp", "+", "-"):
            opened.page.keyboard.press(key)
            seen.add(place.evaluate(ticks))
        # Plus and minus undo each other, all else shows another part of the scene.
        assert len(seen) == 4


def test_a_switch_says_whether_it_is_on(browser, gallery):
    with Opened(browser, gallery["fit"].as_uri()) as opened:
        switch = opened.page.get_by_role("button", name="logarithmic")
        assert switch.get_attribute("aria-pressed") == "false"
        switch.press("Enter")
        assert opened.page.get_by_role("button", name="logarithmic").get_attribute("aria-pressed") == "true"


def test_drive_plays_and_pauses_by_keyboard(browser, gallery):
    with Opened(browser, gallery["drive"].as_uri()) as opened:
        opened.page.keyboard.press("Home")
        opened.page.keyboard.press(" ")
        opened.page.wait_for_function("document.querySelector('input[type=range]').value > 0.2")
        assert opened.page.locator(".play").text_content() == "Pause"
        opened.page.keyboard.press(" ")
        assert opened.page.locator(".play").text_content() == "Play"


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("width", WIDTHS)
def test_result_prints_on_one_sheet(browser, gallery, width, scheme):
    with Opened(browser, gallery["fit"].as_uri(), width, scheme) as opened:
        sheets = re.findall(rb"/Type\s*/Page\b", opened.page.pdf(prefer_css_page_size=True))
        assert len(sheets) == 1
        assert opened.faults == []
