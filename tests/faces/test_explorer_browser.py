"""The explorer in a real browser: dragging, the address, the keyboard, exports, and who is asked for anything."""

import os
import shutil
from urllib.parse import parse_qs, urlsplit

import pytest
from playwright.sync_api import expect, sync_playwright

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
QUIET = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"]
QUIET += ["--disable-component-update", "--disable-sync"]

pytestmark = pytest.mark.skipif(BROWSER is None, reason="no chromium here: the tests in a browser are left out")


@pytest.fixture(scope="module")
def context(served):
    with served() as address, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=QUIET)
        # Latencies are those of a page at rest elsewhere: animations compete with the tests beside this one.
        context = browser.new_context(
            viewport={"width": 1400, "height": 1000}, base_url=address, reduced_motion="reduce"
        )
        yield context
        browser.close()


@pytest.fixture
def page(context):
    page = context.new_page()
    page.troubles = []
    page.asked = []
    page.on("pageerror", lambda error: page.troubles.append(str(error)))
    page.on("console", lambda message: page.troubles.append(message.text) if message.type == "error" else None)
    page.on("request", lambda request: page.asked.append(request.url))
    yield page
    assert page.troubles == []
    assert {urlsplit(url).hostname for url in page.asked} <= {"127.0.0.1", None}
    page.close()


def opened(page, query=""):
    page.goto(f"/{query}")
    expect(page.locator("#says")).not_to_be_empty()
    expect(page.locator("#count")).not_to_be_empty()
    return page


def state(page):
    return {name: values[0] for name, values in parse_qs(urlsplit(page.url).query).items()}


def drag(page, locator, start, end, steps=20):
    box = locator.bounding_box()
    across, up = (lambda at: box["x"] + at[0] * box["width"]), (lambda at: box["y"] + at[1] * box["height"])
    page.mouse.move(across(start), up(start))
    page.mouse.down()
    for i in range(1, steps + 1):
        at = [start[k] + (end[k] - start[k]) * i / steps for k in (0, 1)]
        page.mouse.move(across(at), up(at))
        page.wait_for_timeout(25)
    page.mouse.up()


def test_the_page_says_what_one_sees(page):
    opened(page)
    expect(page.locator("#says")).to_have_text("Three flows share the flux Q = 3.")
    expect(page.locator("#flows label")).to_have_count(3)
    expect(page.locator("#curve .dot")).to_have_count(3)
    for svg in page.locator("#profiles svg").all():
        expect(svg.locator(".line")).to_have_count(3)


def test_dragging_the_slope_redraws_and_the_last_position_wins(page):
    opened(page)
    slider = page.locator("#slope-slider")
    drag(page, slider, (0.38, 0.5), (0.36, 0.5))
    page.wait_for_url("**slope=0.2**")
    slope = float(state(page)["slope"])
    assert float(slider.input_value()) == pytest.approx(1000 * (slope - 0.05) / 0.65, abs=1.0)
    # What is shown in the end belongs to where the slider stands.
    expect(page.locator("#command")).to_contain_text(f"--slope {slope!r} ")


def test_the_address_holds_the_state(page):
    opened(page, "?slope=0.28&Q=2.5&surface=interface&si=1&d=2&theme=dark&flow=0")
    expect(page.locator("#slope")).to_have_value("0.28")
    expect(page.locator("#surface")).to_have_value("interface")
    expect(page.locator("#says")).to_contain_text("2.5")
    expect(page.locator("html")).to_have_attribute("data-theme", "dark")
    expect(page.locator("#d")).to_be_visible()
    says = page.locator("#says").inner_text()
    page.locator("#roughness-slider").press("ArrowRight")
    page.wait_for_url("**roughness=0.600**")
    again = page.context.new_page()
    opened(again, "?" + urlsplit(page.url).query)
    assert again.locator("#slope").input_value() == "0.28"
    assert again.locator("#says").inner_text() == says
    assert again.locator("#roughness").input_value() == page.locator("#roughness").input_value()
    again.close()


def test_a_flow_is_chosen_by_its_point_and_by_the_keyboard(page):
    opened(page)
    page.locator("#curve .dot").nth(2).click()
    expect(page.locator("#flows input").nth(2)).to_be_checked()
    page.locator("#flows input").nth(2).press("ArrowUp")
    expect(page.locator("#flows input").nth(1)).to_be_checked()
    page.wait_for_url("**flow=1**")


def test_moving_along_the_curve_moves_the_flux(page):
    opened(page)
    # From the middle one of three flows to where the curve turns.
    dot, curve = page.locator("#curve .dot").nth(1).bounding_box(), page.locator("#curve")
    box = curve.bounding_box()
    start = ((dot["x"] + dot["width"] / 2 + 12 - box["x"]) / box["width"], (dot["y"] + 10 - box["y"]) / box["height"])
    drag(page, curve, start, (start[0] + 0.05, start[1] + 0.02))
    page.wait_for_function("document.querySelector('#Q').value > 3.05")
    assert 3.05 < float(page.locator("#Q").input_value()) < 5.1
    curve.press("ArrowLeft")
    expect(page.locator("#says")).to_contain_text("share the flux")


def test_typed_values_and_angles(page):
    opened(page)
    page.locator("#angle").fill("15")
    page.locator("#angle").press("Enter")
    expect(page.locator("#slope")).to_have_value("0.267949")
    page.locator("#e").fill("1.5")
    page.locator("#e").press("Enter")
    expect(page.locator("#failure")).to_contain_text("restitution e = 1.5")
    page.locator("#e").fill("0.8")
    page.locator("#e").press("Enter")
    expect(page.locator("#failure")).to_be_hidden()
    page.troubles.clear()  # the browser reports the refusal of e = 1.5


def test_a_chute_without_flows_says_why(page):
    opened(page, "?slope=0.1")
    expect(page.locator("#says")).to_contain_text("No flow carries Q = 3: ")


def test_si_units(page):
    opened(page)
    page.locator("#si").check()
    expect(page.locator("#curve")).to_contain_text("mass flux Q (kg/m/s)")
    # rho d sqrt(g d cos theta) for grains of 1 mm and 2500 kg/m^3
    scale = 2500 * 1e-3 * (9.81 * 1e-3 / (1 + 0.3**2) ** 0.5) ** 0.5
    assert float(page.locator("#Q").input_value()) == pytest.approx(3.0 * scale, rel=1e-4)
    page.locator("#Q").fill(str(4.0 * scale))
    page.locator("#Q").press("Enter")
    expect(page.locator("#says")).to_contain_text("Q = 4")


def test_exports_are_downloaded(page):
    opened(page)
    for what, kind in (("profiles", "csv"), ("curve", "csv"), ("profiles", "png"), ("curve", "svg")):
        with page.expect_download() as download:
            page.locator(f"#exports a[href*='what={what}'][href*='format={kind}']").click()
        assert download.value.suggested_filename == f"chuteflow-{what}.{kind}"
        assert os.path.getsize(download.value.path()) > 1000


def test_everything_can_be_reached_by_tab_and_has_a_name(page):
    opened(page)
    unnamed = page.evaluate(
        """() => [...document.querySelectorAll('input, select, button, [tabindex]')].filter((e) =>
        !(e.labels?.length || e.getAttribute('aria-label') || e.textContent.trim())).map((e) => e.outerHTML)"""
    )
    assert unnamed == []
    reached = set()
    for _ in range(60):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.id"))
    assert {"presets", "slope", "slope-slider", "Q-slider", "curve", "copy-command", "map-over"} <= reached


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_contrast_of_text_and_colours(page, theme):
    opened(page, f"?theme={theme}")
    ratios = page.evaluate(
        """() => {
        const style = getComputedStyle(document.documentElement);
        const level = (name) => {
            const probe = document.body.appendChild(document.createElement('i'));
            probe.style.color = `var(--${name})`;
            const c = getComputedStyle(probe).color.match(/[\\d.]+/g).map((v) => v / 255)
                .map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
            probe.remove();
            return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
        };
        const names = ['ink', 'quiet', 'accent', 'curve', 'flow0', 'flow1', 'flow2', 'flow3', 'flow4'], ratios = {};
        for (const name of names) for (const ground of ['paper', 'panel']) {
            const pair = [level(name), level(ground)].sort();
            ratios[`${name} on ${ground}`] = (pair[1] + 0.05) / (pair[0] + 0.05);
        }
        return ratios;
    }"""
    )
    assert min(ratios.values()) >= 4.5, ratios


def test_it_fits_a_phone(page):
    page.set_viewport_size({"width": 390, "height": 800})
    opened(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert page.locator("#controls").bounding_box()["width"] > 330


def test_latency_from_slider_to_redraw(page):
    opened(page)
    drag(page, page.locator("#slope-slider"), (0.36, 0.5), (0.40, 0.5), steps=60)
    times = page.evaluate(
        """() => Object.fromEntries(['flows-redraw', 'curve-redraw'].map((name) =>
        [name, performance.getEntriesByName(name).map((entry) => entry.duration).sort((a, b) => a - b)]))"""
    )
    middle = {name: durations[len(durations) // 2] for name, durations in times.items()}
    assert len(times["flows-redraw"]) > 10
    # Six times the targets of 50 and 150 ms, since other tests run beside this one.
    assert middle["flows-redraw"] < 300.0, middle
    assert middle["curve-redraw"] < 900.0, middle
