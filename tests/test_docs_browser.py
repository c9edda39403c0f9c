"""Every page of the built documentation in a real browser: no error of mathematics or scripts, nothing too wide."""

import shutil

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import sync_playwright

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
QUIET = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"]
QUIET += ["--disable-component-update", "--disable-sync"]
#: A desk and a telephone, in pixels.
WIDTHS = (1280, 390)
#: Errors that MathJax writes into the page, once all is typeset.
ERRORS_OF_MATHEMATICS = """async () => {
  if (window.MathJax?.startup) await MathJax.startup.promise;
  return [...document.querySelectorAll("mjx-merror")].map((found) => found.dataset.mjxError ?? found.textContent);
}"""
#: Formulas that were left as text.
NOT_TYPESET = """() => {
  const formulas = [...document.querySelectorAll("div.math, span.math")];
  return formulas.filter((one) => !one.querySelector("mjx-container")).map((one) => one.textContent);
}"""
#: Visible elements that reach beyond the window, unless something around them scrolls by itself.
TOO_WIDE = """() => {
  const width = document.documentElement.clientWidth;
  const scrolls = (one) => one && one !== document.body
    && (["auto", "scroll"].includes(getComputedStyle(one).overflowX) || scrolls(one.parentElement));
  const wide = [...document.querySelectorAll("article *, header *, footer *")].filter((one) => {
    const box = one.getBoundingClientRect();
    return box.width > 1 && box.height > 1 && box.right > width + 1 && one.checkVisibility() && !scrolls(one);
  });
  const words = wide.map((one) => `${one.tagName} ${one.className}: ${one.textContent.slice(0, 60)}`);
  return document.documentElement.scrollWidth > width ? ["the page scrolls sideways", ...words] : words;
}"""

pytestmark = pytest.mark.skipif(BROWSER is None, reason="no chromium here: the tests in a browser are left out")


@pytest.fixture(scope="module")
def tab():
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=QUIET)
        yield browser.new_context().new_page()
        browser.close()


def faults(tab, path):
    """What is wrong with the page in a file, as sentences."""
    found = []

    def hear(message):
        if message.type in ("error", "warning"):
            found.append(message.text)

    def fail(error):
        found.append(str(error))

    def miss(request):
        found.append(f"not loaded: {request.url}")

    for event, listen in (("console", hear), ("pageerror", fail), ("requestfailed", miss)):
        tab.on(event, listen)
    tab.set_viewport_size({"width": WIDTHS[0], "height": 800})
    tab.goto(path.as_uri())
    found += tab.evaluate(ERRORS_OF_MATHEMATICS) + tab.evaluate(NOT_TYPESET)
    for width in WIDTHS:
        tab.set_viewport_size({"width": width, "height": 800})
        found += [f"at {width} pixels: {what}" for what in tab.evaluate(TOO_WIDE)]
    for event, listen in (("console", hear), ("pageerror", fail), ("requestfailed", miss)):
        tab.remove_listener(event, listen)
    return found


def assert_sound(tab, site):
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 30
    found = {str(path.relative_to(site)): faults(tab, path) for path in pages}
    assert {page: what for page, what in found.items() if what} == {}


def test_every_page_of_the_site(tab, quick_site):
    assert_sound(tab, quick_site)


@pytest.mark.slow
def test_every_page_of_the_whole_site(tab, whole_site):
    assert_sound(tab, whole_site)


#: Levels of WCAG, and a rule that is left out: Sphinx nests the lists of arguments in its reference otherwise.
ACCESSIBLE = {
    "runOnly": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"],
    "rules": {"definition-list": {"enabled": False}},
}


def violations(tab):
    """Rules of WCAG AA that the page breaks, each with its first element."""
    found = Axe().run(tab, options=ACCESSIBLE).response["violations"]
    return [f"{one['id']}: {one['nodes'][0]['html'][:100]}" for one in found]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_page_keeps_the_rules_of_wcag(tab, quick_site, scheme):
    tab.emulate_media(color_scheme=scheme)
    tab.goto((quick_site / "howto" / "units.html").as_uri())
    assert violations(tab) == []


@pytest.mark.slow
def test_every_page_keeps_the_rules_of_wcag(tab, whole_site):
    tab.emulate_media(color_scheme="light")
    found = {}
    for path in sorted(whole_site.rglob("*.html")):
        tab.goto(path.as_uri())
        found[str(path.relative_to(whole_site))] = violations(tab)
    assert {page: what for page, what in found.items() if what} == {}


@pytest.mark.parametrize(
    ("content", "rule"),
    [
        ("<p>a page</p>", None),
        ("<p style='color: #999; background: #fff'>faint</p>", "color-contrast"),
        ("<input type='text'>", "label"),
        ("<button></button>", "button-name"),
        ("<img src='data:,'>", "image-alt"),
    ],
)
def test_a_broken_rule_is_seen(tab, tmp_path, content, rule):
    page = tmp_path / "page.html"
    page.write_text(f"<!doctype html><html lang=en><title>x</title><main>{content}</main></html>", encoding="utf-8")
    tab.goto(page.as_uri())
    found = [one.partition(":")[0] for one in violations(tab)]
    assert found == ([] if rule is None else [rule])


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        ("<p>a page</p>", None),
        ("<script>console.error('broken')</script>", "broken"),
        ("<script>undefined_name</script>", "undefined_name is not defined"),
        ("<img src='nothing.png' alt='' />", "not loaded"),
        ("<p style='width: 600px'>wide</p>", "at 390 pixels: P : wide"),
        ("<div style='overflow-x: hidden'><p style='width: 600px'>cut off</p></div>", "at 390 pixels: P : cut off"),
        ("<div style='overflow-x: auto'><p style='width: 600px'>scrolls</p></div>", None),
        ("<mjx-merror data-mjx-error='no tag here'></mjx-merror>", "no tag here"),
        (r"<div class='math'>\[ x \]</div>", r"\[ x \]"),
    ],
)
def test_a_fault_is_seen(tab, tmp_path, content, fault):
    page = tmp_path / "page.html"
    page.write_text(f"<!doctype html><html><body><article>{content}</article></body></html>", encoding="utf-8")
    found = faults(tab, page)
    assert found == [] if fault is None else any(fault in what for what in found)
