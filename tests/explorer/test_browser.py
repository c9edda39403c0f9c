"""The explorer in a real browser: dragging, the address, the keyboard, exports, and who is asked for anything."""

import re
import shutil
from itertools import pairwise
from pathlib import Path
from statistics import median
from urllib.parse import parse_qs, urlsplit
from xml.etree import ElementTree

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect, sync_playwright

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
QUIET = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"]
QUIET += ["--disable-component-update", "--disable-sync"]

pytestmark = pytest.mark.skipif(BROWSER is None, reason="no chromium here: the tests in a browser are left out")


@pytest.fixture(scope="module")
def tab(served):
    with served() as address, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=QUIET)
        tab = browser.new_context(base_url=address).new_page()
        troubles, asked = [], []
        tab.on("pageerror", lambda error: troubles.append(str(error)))
        tab.on("console", lambda message: troubles.append(message.text) if message.type == "error" else None)
        tab.on("request", lambda request: asked.append(request.url))
        vars(tab).update(troubles=troubles, asked=asked, address=address)
        # The search may have to be compiled first.
        tab.goto("/")
        expect(tab.locator("#says")).not_to_be_empty(timeout=120_000)
        asked.clear()
        yield tab
        browser.close()


@pytest.fixture
def whole_page(tab):
    """The page as it is, in a tab as new; animations rest, since they compete with the tests beside this one."""
    tab.set_viewport_size({"width": 1400, "height": 1000})
    tab.emulate_media(reduced_motion="reduce", color_scheme="light")
    tab.troubles.clear()
    tab.asked.clear()
    yield tab
    assert tab.troubles == []
    assert {urlsplit(url).hostname for url in tab.asked} <= {"127.0.0.1", None}
    tab.goto("about:blank")
    tab.unroute_all()


@pytest.fixture
def page(whole_page):
    """The page without what is computed in the background, for tests of the rest."""
    unknown = {"state": "unknown", "says": "not known", "waves": ""}
    whole_page.route("**/ask/stability?*", lambda route: route.fulfill(json=unknown))
    whole_page.route("**/ask/map?*", lambda route: route.fulfill(json={"error": "no map"}))
    return whole_page


def opened(page, query=""):
    page.goto(f"/{query}")
    expect(page.locator("#says")).not_to_be_empty()
    expect(page.locator("#count")).not_to_be_empty()
    # Panels that have grown are drawn once more.
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => setTimeout(done, 50)))")
    return page


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
    expect(page.locator("#says")).to_contain_text("Three flows share the flux Q = 3: one hot, dilute, deep;")
    expect(page.locator("#flows label")).to_have_count(3)
    expect(page.locator("#curve .dot")).to_have_count(3)
    colours = [dot.get_attribute("fill") for dot in page.locator("#curve .dot").all()]
    for svg in page.locator("#profiles svg").all():
        assert [line.get_attribute("stroke") for line in svg.locator(".line").all()] == colours
    swatches = page.locator("#flows .swatch circle").all()
    assert [swatch.get_attribute("fill") for swatch in swatches] == colours
    assert page.locator("#curve .special").count() >= 3  # folds and the onset of inversion
    expect(page.locator("#budget .line")).to_have_count(3)
    expect(page.locator("#budget-words")).to_contain_text("slip on the base 67 %")


def test_dragging_the_slope_redraws_and_the_last_position_wins(page):
    opened(page)
    slider = page.locator("#slope-slider")
    drag(page, slider, (0.38, 0.5), (0.36, 0.5))
    slope = float(page.locator("#slope").input_value())
    assert 0.27 < slope < 0.29
    assert float(slider.input_value()) == pytest.approx(1000 * (slope - 0.05) / 0.65, abs=1.0)
    page.wait_for_url(f"**slope={slope!r}**")
    # What is shown in the end belongs to where the slider stands.
    expect(page.locator("#command")).to_contain_text(f"--slope {slope!r} ")
    expect(page.locator("#map-here")).to_have_attribute("cx", re.compile(r"\d"))


def test_of_many_positions_at_once_the_last_wins_and_few_are_asked(page):
    opened(page)
    page.asked.clear()
    page.evaluate(
        """() => {
        const slider = document.querySelector('#slope-slider');
        for (let place = 340; place <= 400; place++) {
            slider.value = place;
            slider.dispatchEvent(new Event('input'));
        }
    }"""
    )
    expect(page.locator("#command")).to_contain_text("--slope 0.31 ")
    asked = [url for url in page.asked if "ask/flows" in url]
    assert len(asked) == 2  # the first position, and the last
    assert "slope=0.31&" in asked[-1]


def test_the_address_holds_the_state(page):
    opened(page, "?slope=0.28&Q=2.5&surface=interface&si=1&d=2&theme=dark&flow=0")
    expect(page.locator("#slope")).to_have_value("0.28")
    expect(page.locator("#surface")).to_have_value("interface")
    expect(page.locator("#command")).to_contain_text("--flux 2.5 --diameter 0.002 --density 2500.0")
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


def test_an_address_with_what_there_is_not(page):
    opened(page, "?x=foo&y=bar&against=zz&shade=zz&theme=pink&flow=99")
    for name, value in (("map-x", "slope"), ("map-y", "roughness"), ("against", "h"), ("shade", "most"), ("theme", "")):
        expect(page.locator(f"#{name}")).to_have_value(value)
    expect(page.locator("#flows input").nth(2)).to_be_checked()
    opened(page, "?x=e&y=e")
    expect(page.locator("#map-y")).to_have_value("roughness")
    page.goto("/?slope=steep")
    expect(page.locator("#failure")).to_contain_text("slope = 'steep': must be a number")


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


@pytest.mark.parametrize("names", [("slope", "e", "ew", "roughness", "Q", "angle"), ("d", "rho", "Q")])
def test_any_value_can_be_typed_and_taken_back(page, names):
    opened(page, "?si=1" if "d" in names else "")
    failure, says = page.locator("#failure"), page.locator("#says").inner_text()
    for name in names:
        field = page.locator(f"#{name}")
        before = field.input_value()
        for value in ("0", "-1", "1e308", "", "1e-", "2"):
            field.fill("")
            field.press_sequentially(value)
            field.press("Enter")
            # The page is not blocked, and says what is wrong on one line or shows what holds.
            assert page.evaluate("1 + 1") == 2
            if value in ("", "1e-"):
                expect(failure).to_contain_text("must be ")
            elif value == "-1":
                expect(failure).to_be_visible()
        field.fill(before)
        field.press("Enter")
        expect(failure).to_be_hidden()
        expect(page.locator("#says")).to_have_text(says)
    expect(page.locator("main")).not_to_have_class("outdated")


def place_of(route):
    """The place of the column of the map that is asked for."""
    return float(parse_qs(urlsplit(route.request.url).query)["place"][0])


def test_both_ends_of_every_slider(page):
    opened(page)
    for name in ("slope", "e", "ew", "roughness", "Q"):
        for key in ("Home", "End"):
            page.locator(f"#{name}-slider").press(key)
            page.wait_for_timeout(100)
    expect(page.locator("#words")).to_have_attribute("aria-busy", "false")


@pytest.mark.parametrize("query", ["Q=0", "Q=1e999", "slope=NaN&si=1", "si=1&d=0&rho=x", "roughness=nan&x=e"])
def test_any_address_is_drawn_or_refused(page, query):
    page.goto(f"/?{query}")
    expect(page.locator("#failure")).to_be_visible()
    if query.startswith("Q"):
        expect(page.locator("#count")).to_contain_text("3 for Q from")


def test_a_message_goes_with_what_it_was_about(page):
    def column(route):
        if parse_qs(urlsplit(route.request.url).query)["e"] == ["2"]:
            route.continue_()
            return
        parts = {name: {"stops": [], "values": [1]} for name in ("most", "families", "interior", "density", "hot")}
        at = 0.05 + 0.65 * place_of(route)
        route.fulfill(json={"outer": "slope", "inner": "roughness", "at": at, "parts": parts, "tolerance": 0.01})

    page.unroute("**/ask/map?*")
    page.route("**/ask/map?*", column)
    opened(page)
    expect(page.locator("#map-key")).to_contain_text("At most this many flows")
    page.locator("#e").fill("2")
    page.locator("#e").press("Enter")
    expect(page.locator("#failure")).to_contain_text("restitution e = 2")
    expect(page.locator("#map-key")).to_have_text("No map of this chute.")
    page.locator("#e").fill("0.8")
    page.locator("#e").press("Enter")
    expect(page.locator("#map-key")).to_contain_text("At most this many flows")
    expect(page.locator("body")).not_to_contain_text("e = 2")
    expect(page.locator("#failure")).to_be_hidden()


def test_what_takes_too_long_is_said_and_nothing_of_before_is_shown(page):
    opened(page)
    left_out = {"error": "left out: no time", "flows": [], "chute": {"slope": 0.31}}
    left_out["recipes"] = {"command": "chuteflow solve --slope 0.31", "python": "import chuteflow"}
    page.route("**/ask/flows?*", lambda route: route.fulfill(json=left_out | {"status": 422}))
    page.route("**/ask/curve?*", lambda route: route.fulfill(json={"error": "no curve: no time", "status": 422}))
    page.locator("#slope").fill("0.31")
    page.locator("#slope").press("Enter")
    expect(page.locator("#says")).to_have_text("Left out: no time.")
    expect(page.locator("#curve-words")).to_have_text("No curve: no time.")
    expect(page.locator("#flows label")).to_have_count(0)
    expect(page.locator("#curve .line, #profiles .line, #budget .line")).to_have_count(0)
    expect(page.locator("#command")).to_have_text("chuteflow solve --slope 0.31")
    expect(page.locator("#failure")).to_be_hidden()


def test_a_server_without_room_is_asked_again_for_a_while(page):
    opened(page)
    times = []

    def refuse(route):
        times.append(1)
        if len(times) < 3:
            route.fulfill(json={"error": "ask again", "status": 503})
        else:
            route.continue_()

    page.route("**/ask/flows?*", refuse)
    page.locator("#Q").fill("2")
    page.locator("#Q").press("Enter")
    expect(page.locator("#says")).to_contain_text("One flow carries the flux Q = 2")
    page.troubles.clear()


def test_flows_beyond_the_theory_are_marked(page):
    def told(route):
        answer = route.fetch().json()
        for i, flow in enumerate(answer["flows"]):
            flow["validity"] = {"words": ["dense: beyond the theory"] if i == 2 else []}
        route.fulfill(json=answer)

    def passed(route):
        (branch,) = page.request.get(route.request.url.replace("limits", "curve")).json()["branches"]
        route.fulfill(json={"words": [[["large slip"] if q > 6.0 else [] for q in branch["Q"]]]})

    page.route("**/ask/flows?*", told)
    page.route("**/ask/limits?*", passed)
    opened(page)
    expect(page.locator("#flows .beyond")).to_have_text("dense: beyond the theory")
    expect(page.locator("#profile-nu .beneath")).to_have_count(1)
    expect(page.locator("#profile-nu .line")).to_have_count(3)
    expect(page.locator("#curve .beneath")).to_have_count(1)
    expect(page.locator("#beyond")).to_contain_text("large slip (u_base above sqrt(T_base)")
    expect(page.locator("#curve .limit")).to_have_count(1)
    assert page.locator("#curve .limit title").text_content() in ("large slip", "within the theory")


def test_the_surface_temperature_is_called_what_it_is(page):
    opened(page, "?against=T_surface")
    expect(page.locator("#curve")).to_contain_text("Tsurface, far above")
    expect(page.locator("#flows .numbers").nth(0)).to_contain_text("Tsurface 7.339")
    page.locator("#surface").select_option("interface")
    expect(page.locator("#curve")).to_contain_text("Tsurface, at the interface")


def test_what_is_not_known_of_the_map_is_hatched(page):
    def column(route):
        place = place_of(route)
        at = 0.05 + 0.65 * place
        if 0.4 < place < 0.6:
            route.fulfill(json={"error": "this column of the map is left out", "status": 422})
            return
        parts = {name: {"stops": [0.6 + 0.1 * place], "values": [1, 2]} for name in ("most", "families", "hot")}
        route.fulfill(json={"outer": "slope", "inner": "roughness", "at": at, "parts": parts, "tolerance": 0.01})

    page.unroute("**/ask/map?*")
    page.route("**/ask/map?*", column)
    opened(page)
    expect(page.locator("#map-key")).to_contain_text("hatched: not known")
    expect(page.locator("#map path.unknown")).to_have_count(1)
    left, right = page.evaluate(
        "(({ x, width }) => [x, x + width])(document.querySelector('#map path.unknown').getBBox())"
    )
    box = page.locator("#map").bounding_box()
    # From half-way before the first column that is not known to half-way behind the last.
    assert 0.3 * box["width"] < left < right < 0.7 * box["width"]


def test_regions_of_the_map_end_in_points_and_slanted_lines(page):
    # A boundary that is steep: each column has it somewhere else, those beside it not at all.
    def column(route):
        place = place_of(route)
        fraction = 0.5 + (place - 0.5) / 0.1
        low, high = 0.5, 3**0.5 / 2
        inside = 0.0 < fraction < 1.0
        part = {
            "stops": [low + fraction * (high - low)] if inside else [],
            "values": [2, 1] if inside else [2 if fraction >= 1.0 else 1],
        }
        none = {"stops": [], "values": [0]}
        parts = {"most": part, "families": part, "interior": none, "density": none, "hot": none}
        at = 0.05 + 0.65 * place
        route.fulfill(json={"outer": "slope", "inner": "roughness", "at": at, "parts": parts, "tolerance": 0.01})

    page.unroute("**/ask/map?*")
    page.route("**/ask/map?*", column)
    opened(page)
    expect(page.locator("#map-key")).to_contain_text("At most this many flows")
    expect(page.locator("#map-key")).not_to_contain_text("Drawing", timeout=20_000)
    # Where a column of pixels crosses the boundary rises with its place, without steps.
    heights = page.evaluate(
        """() => {
        const map = document.querySelector('#map'), box = map.getBoundingClientRect(), point = map.createSVGPoint();
        const region = map.querySelectorAll('g > path[fill]')[1], tops = [];
        for (let x = 0; x < box.width; x++) {
            const inside = [];
            for (let y = 0; y < box.height; y++) {
                [point.x, point.y] = [x + 0.5, y + 0.5];
                if (region.isPointInFill(point)) inside.push(y);
            }
            if (inside.length) tops.push(box.height - Math.min(...inside));
        }
        return tops;
    }"""
    )
    steps = [after - before for before, after in pairwise(heights)]
    assert min(steps) >= -1.0
    # 360 pixels in all, over a tenth of the width.
    assert max(steps) < 40.0, steps


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
    expect(page.locator("#says")).to_contain_text(f"Q = {4.0 * scale:.5g} kg/m/s")
    expect(page.locator("#command")).to_contain_text("--flux 4.0 --diameter 0.001 --density 2500.0")


def test_exports_are_downloaded(page):
    opened(page, "?slope=0.31&flow=2")
    for export in ("profiles-csv", "curve-svg", "chute-svg", "chute-png"):
        what, kind = export.split("-")
        with page.expect_download() as download:
            page.locator(f"[data-export={export}]").click()
        assert download.value.suggested_filename == f"chuteflow-{what}.{kind}"
        content = Path(download.value.path()).read_bytes()
        assert len(content) > 1000
        if kind == "csv":
            assert b"slope = 0.31" in content
        if export == "chute-svg":
            root = ElementTree.fromstring(content)
            assert len(root.findall(".//{*}circle")) > 25
            assert "not a simulation" in root.findtext("{*}title", "")


def test_the_map_is_drawn_and_its_cross_hair_moves_the_chute(whole_page):
    page = whole_page
    opened(page)
    expect(page.locator("#map-key")).to_contain_text("At most this many flows share one flux", timeout=60_000)
    assert page.locator("#map g > path[fill]").count() >= 3
    page.locator("#map").scroll_into_view_if_needed()
    box, here = page.locator("#map").bounding_box(), page.locator("#map-here")
    start = [float(here.get_attribute(at)) / box[side] for at, side in (("cx", "width"), ("cy", "height"))]
    asked = len([url for url in page.asked if "ask/map" in url and "place=0&" in url + "&"])
    drag(page, page.locator("#map"), start, (start[0] + 0.03, start[1] - 0.05), steps=5)
    page.wait_for_url("**roughness=**")
    assert 0.31 < float(page.locator("#slope").input_value()) < 0.34
    assert 0.61 < float(page.locator("#roughness").input_value()) < 0.66
    slope = float(page.locator("#slope").input_value())
    page.locator("#map").press("ArrowRight")
    expect(page.locator("#slope")).to_have_value(f"{slope + 0.65 / 200:.4g}")
    # One map serves every position of the cross-hair.
    assert len([url for url in page.asked if "ask/map" in url and "place=0&" in url + "&"]) == asked
    page.locator("#shade").select_option("density")
    expect(page.locator("#map-key")).to_contain_text("Densities among the flows")
    page.locator("#map-y").select_option("slope")
    expect(page.locator("#map-x")).to_have_value("roughness")


def test_each_flow_is_told_stable_or_not_when_the_sliders_rest(whole_page):
    page = whole_page
    opened(page)
    expect(page.locator("#flows .stability").nth(0)).to_contain_text("unstable: waves across the slope", timeout=60_000)
    page.locator("#surface").select_option("interface")
    expect(page.locator("#flows .stability").nth(0)).to_contain_text("not known whether it is stable", timeout=60_000)


def test_stability_that_is_superseded_is_taken_back(whole_page):
    page = whole_page
    opened(page)
    ended = []
    page.on("requestfailed", lambda request: ended.append(request.url))
    with page.expect_request(lambda request: "ask/stability" in request.url and "Q=3.3" in request.url):
        page.locator("#Q").fill("3.3")
        page.locator("#Q").press("Enter")
    page.locator("#Q").fill("3.4")
    page.locator("#Q").press("Enter")
    expect(page.locator("#says")).to_contain_text("Q = 3.4")
    assert any("ask/stability" in url and "Q=3.3" in url for url in ended)


def test_presets_are_cases_of_the_paper(page):
    opened(page)
    page.locator("#presets").select_option(label="Beneath an interface (figures 7 to 9)")
    expect(page.locator("#surface")).to_have_value("interface")
    expect(page.locator("#command")).to_contain_text("--surface interface ")
    page.wait_for_url("**surface=interface**")


def test_the_picture_of_the_chute_moves_unless_less_motion_is_asked_for(page):
    opened(page)
    picture = "document.querySelector('#chute').toDataURL()"
    expect(page.locator("#chute-key")).to_contain_text("A drawing of the computed fields, not a simulation")
    expect(page.locator("#pause")).to_have_text("play")
    before = page.evaluate(picture)
    page.wait_for_timeout(150)
    assert page.evaluate(picture) == before
    page.emulate_media(reduced_motion="no-preference")
    expect(page.locator("#pause")).to_have_text("pause")
    page.wait_for_timeout(150)
    assert page.evaluate(picture) != before
    page.locator("#pause").click()
    expect(page.locator("#pause")).to_have_text("play")


def test_colours_follow_the_system_or_the_choice(page):
    ground = "getComputedStyle(document.body).backgroundColor"
    page.emulate_media(color_scheme="dark")
    opened(page)
    dark = page.evaluate(ground)
    page.locator("#theme").select_option("light")
    assert page.evaluate(ground) == "rgb(255, 255, 255)" != dark
    expect(page.locator("#curve .dot").nth(0)).to_have_attribute("fill", "#0061a8")
    page.emulate_media(color_scheme="light")
    page.locator("#theme").select_option("dark")
    assert page.evaluate(ground) == dark


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
    controls = {f"{name}{part}" for name in ("slope", "e", "ew", "roughness", "Q") for part in ("", "-slider")}
    others = {"presets", "si", "theme", "angle", "surface", "closure", "against", "whole", "curve", "pause", "map"}
    assert controls | others | {"map-x", "map-y", "shade", "copy-address", "copy-command", "copy-python"} <= reached


def test_every_slider_moves_by_the_keyboard_and_is_explained(page):
    opened(page)
    for name in ("slope", "e", "ew", "roughness", "Q"):
        slider, before = page.locator(f"#{name}-slider"), page.locator(f"#{name}").input_value()
        slider.press("ArrowRight")
        assert float(page.locator(f"#{name}").input_value()) > float(before)
        for control in (slider, page.locator(f"#{name}")):
            described = control.get_attribute("aria-describedby")
            assert page.locator(f"#{described}").inner_text().endswith(".")


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
        const flows = ['flow0', 'flow1', 'flow2', 'flow3', 'flow4'];
        const names = ['ink', 'quiet', 'accent', 'curve', 'warning', 'pin', 'edge', ...flows];
        const ratios = {};
        for (const name of names) for (const ground of ['paper', 'panel']) {
            const pair = [level(name), level(ground)].sort((a, b) => a - b);
            ratios[`${name} on ${ground}`] = (pair[1] + 0.05) / (pair[0] + 0.05);
        }
        return ratios;
    }"""
    )
    # WCAG 2 AA: 4.5 for text and 3 for the edges of what one operates.
    assert min(ratio for name, ratio in ratios.items() if not name.startswith("edge")) >= 4.5, ratios
    assert min(ratios.values()) >= 3.0, ratios
    # Every text is of one of those colours: nothing else is set.
    used = page.evaluate(
        """() => {
        const text = (e) => [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim());
        const all = [...document.querySelectorAll('body *')].filter((e) => text(e) && e.checkVisibility());
        return [...new Set(all.map((e) => getComputedStyle(e)[e instanceof SVGElement ? 'fill' : 'color']))];
    }"""
    )
    known = page.evaluate(
        """() => ['ink', 'quiet', 'accent'].map((name) => {
        const probe = document.body.appendChild(document.createElement('i'));
        probe.style.color = `var(--${name})`;
        const c = getComputedStyle(probe).color;
        probe.remove();
        return c;
    })"""
    )
    assert set(used) <= set(known)


@pytest.mark.parametrize("query", ["?theme=light", "?theme=dark&si=1&surface=interface"])
def test_the_page_keeps_the_rules_of_wcag(page, query):
    opened(page, query)
    page.locator("#pin").click()
    broken = Axe().run(page).response["violations"]
    assert [f"{one['id']}: {one['nodes'][0]['html'][:100]}" for one in broken] == []


@pytest.mark.parametrize("query", ["", "?si=1&surface=interface&against=T_surface&slope=0.31"])
def test_it_fits_a_phone_and_a_desk(page, query):
    for width in (1280, 701, 390):
        page.set_viewport_size({"width": width, "height": 800})
        opened(page, query)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.evaluate(BEYOND_THE_WINDOW) == []
    assert page.locator("#controls").bounding_box()["width"] > 330


BEYOND_THE_WINDOW = """() => [...document.querySelectorAll('section *, form *, header *')]
    .filter((e) => e.checkVisibility() && !e.closest('svg, .skip'))
    .filter((e) => e.getBoundingClientRect().right > innerWidth + 0.5)
    .map((e) => e.outerHTML.slice(0, 80))"""


def test_latency_from_slider_to_redraw(whole_page):
    page = whole_page
    opened(page)
    drag(page, page.locator("#slope-slider"), (0.36, 0.5), (0.40, 0.5), steps=40)
    times = page.evaluate(
        """() => Object.fromEntries(['flows-redraw', 'curve-redraw'].map((name) =>
        [name, performance.getEntriesByName(name).map((entry) => entry.duration)]))"""
    )
    assert len(times["flows-redraw"]) > 10
    middle = {name: median(durations) for name, durations in times.items()}
    # Targets are 50 and 150 ms on a machine at rest. Here other tests run beside this one: so much slower is a page
    # on which dragging no longer works, whatever else goes on.
    assert middle["flows-redraw"] < 10 * 50.0, middle
    assert middle["curve-redraw"] < 10 * 150.0, middle


def test_a_drag_is_one_step_to_take_back(page):
    opened(page)
    expect(page.locator("#undo")).to_have_attribute("aria-disabled", "true")
    drag(page, page.locator("#slope-slider"), (0.38, 0.5), (0.36, 0.5))
    slope = page.locator("#slope").input_value()
    page.wait_for_url(f"**slope={slope}**")
    drag(page, page.locator("#e-slider"), (0.6, 0.5), (0.62, 0.5))
    page.wait_for_url(lambda url: "e=0.8&" not in url)
    page.go_back()
    expect(page.locator("#e")).to_have_value("0.8")
    expect(page.locator("#command")).to_contain_text(f"--slope {slope} --e 0.8 ")
    page.locator("#undo").click()
    expect(page.locator("#slope")).to_have_value("0.3")
    expect(page.locator("#undo")).to_have_attribute("aria-disabled", "true")
    page.keyboard.press("Control+Shift+Z")
    expect(page.locator("#slope")).to_have_value(slope)
    page.locator("#surface").focus()
    page.keyboard.press("Control+Z")
    expect(page.locator("#slope")).to_have_value("0.3")


@pytest.mark.slow
def test_the_chosen_case_is_shown_as_long_as_it_holds(page):
    opened(page)
    shown = page.locator("#presets option:checked")
    expect(shown).to_contain_text("Three flows at one flux")
    page.locator("#presets").select_option(label="glass-beads")
    expect(page.locator("#e")).to_have_value("0.97")
    expect(page.locator("#d")).to_have_value("3")
    expect(page.locator("#case-words")).to_contain_text("guessed: roughness")
    page.locator("#slope-slider").press("ArrowRight")
    expect(shown).to_have_text("glass-beads")
    page.locator("#e-slider").press("ArrowRight")
    expect(shown).to_have_text("custom")
    expect(page.locator("#case-words")).to_be_empty()


def test_flows_of_the_curve_are_examined_one_by_one_and_no_more_is_said(page):
    def examined(route):
        query = parse_qs(urlsplit(route.request.url).query)
        if "point" not in query:
            route.fulfill(json={"state": "unknown", "says": "not known", "waves": ""})
            return
        asked.append(int(query["point"][0]))
        state = ("stable", "unstable", "unknown")[len(asked) % 3]
        searched = [2.0 + len(asked), 100.0 - len(asked)]
        route.fulfill(json={"state": state, "says": f"it is {state}", "waves": "", "searched": searched})

    asked = []
    page.unroute("**/ask/stability?*")
    page.route("**/ask/stability?*", examined)
    opened(page)
    said = page.locator("#stability-words")
    expect(said).to_have_text(
        "Stability of 9 flows of the curve: × unstable (3), ■ stable (3), ? not known (3). "
        "Between them nothing is known. Each was examined for waves of at least 11 to 91 d."
    )
    assert len(set(asked)) == 9
    assert page.locator("#curve .stability-mark").count() == 9
    assert page.locator("#curve .stability-mark.stable title").all_text_contents() == ["it is stable"] * 3
    page.locator("#stability").uncheck()
    expect(said).to_have_text("Stability along the curve is not examined.")
    expect(page.locator("#curve .stability-mark")).to_have_count(0)
    page.locator("#stability").check()
    expect(page.locator("#curve .stability-mark")).to_have_count(9)
    page.locator("#Q-slider").press("ArrowRight")
    expect(said).to_contain_text("Stability of 9 flows")
    # Where the question cannot be posed, it is asked once.
    page.unroute("**/ask/stability?*")
    page.locator("#surface").select_option("interface")
    expect(said).to_contain_text("Stability of 1 flow of the curve, 8 to come: × unstable (0)", timeout=20_000)


def test_values_are_read_off_every_chart_by_mouse_and_by_keyboard(page):
    opened(page)
    answer = page.request.get("/ask/flows?slope=0.3&e=0.8&ew=0.8&roughness=0.6&Q=3").json()
    page.locator("#profile-nu").hover(position={"x": 60, "y": 150})
    tip = page.locator("#profile-nu .tip tspan").all_text_contents()
    height = float(tip[0].removeprefix("z "))
    for flow, said in zip(answer["flows"], tip[1:], strict=True):
        expected = np.interp(height, flow["profile"]["z"], flow["profile"]["nu"])
        assert float(said.removeprefix("ν ")) == pytest.approx(expected, rel=0.02, abs=1e-6)
    # The same height is read in the other charts.
    assert page.locator("#profile-u .tip tspan").first.text_content() == tip[0]
    page.mouse.move(2, 2)
    expect(page.locator(".tip")).to_have_count(0)
    box = page.locator("#curve").bounding_box()
    x, y = page.evaluate(
        "(({ x, y }) => [x + 6, y + 6])(document.querySelectorAll('#curve .dot')[2].getBoundingClientRect())"
    )
    page.mouse.move(x, y)
    expect(page.locator("#curve .tip")).to_contain_text(re.compile(r"Q (3|3\.0\d*|2\.9\d*), h 1\.7\d*density inverted"))
    page.mouse.move(box["x"] + 0.9 * box["width"], box["y"] + 0.7 * box["height"])
    expect(page.locator("#curve .tip")).to_have_count(0)
    page.locator("#pause").focus()
    page.keyboard.press("Tab")
    expect(page.locator("#budget")).to_be_focused()
    for key, said in (("Home", "z 0, work "), ("ArrowUp", "z 0.552, work "), ("PageDown", "z 0, work ")):
        page.keyboard.press(key)
        expect(page.locator("#spoken")).to_contain_text(said)
        expect(page.locator("#budget .tip")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.locator(".tip")).to_have_count(0)
    page.keyboard.press("Shift+Tab")
    page.locator("#map-panel").scroll_into_view_if_needed()
    page.locator("#map").hover(position={"x": 150, "y": 100})
    expect(page.locator("#map .tip")).to_contain_text("flows at one flux: not known")
    page.locator("#map").press("ArrowRight")
    expect(page.locator("#spoken")).to_contain_text("roughness 0.6, flows at one flux: not known")


def test_pinned_flows_stay_drawn_until_they_are_removed(page):
    opened(page)
    page.locator("#pin").click()
    page.locator("#flows input").nth(2).check()
    page.locator("#pin").click()
    table = page.locator("#pinned tbody tr")
    expect(table).to_have_count(2)
    expect(table.nth(0)).to_contain_text("38.8390.43927.339hot, dilute, deep")
    expect(page.locator("#curve .pin")).to_have_count(2)
    expect(page.locator("#profile-nu .line")).to_have_count(5)
    before = page.locator("#curve .line").count()
    page.locator("#slope").fill("0.31")
    page.locator("#slope").press("Enter")
    expect(page.locator("#says")).to_contain_text("One flow carries")
    # The flows stay as they were, and so does the curve of their chute.
    expect(table.nth(0)).to_contain_text("0.338.8390.43927.339hot, dilute, deep")
    expect(page.locator("#profile-nu .line")).to_have_count(3)
    expect(page.locator("#curve .line[stroke-width='1.5']")).to_have_count(2)
    assert before > 0
    # The chosen one is the only flow, though the third was chosen before.
    page.locator("#pin").click()
    expect(table.nth(2)).to_contain_text("cold, dense, shallow")
    page.wait_for_url("**7C0.31**")
    page.reload()
    expect(table).to_have_count(3)
    page.get_by_role("button", name="remove b").click()
    expect(table).to_have_count(2)
    page.get_by_role("button", name="show a").click()
    expect(page.locator("#slope")).to_have_value("0.3")
    expect(page.locator("#flows input").nth(0)).to_be_checked()
    page.locator("#undo").click()
    expect(page.locator("#slope")).to_have_value("0.31")
    page.locator("#undo").click()
    expect(table).to_have_count(3)


@pytest.mark.slow
def test_a_pin_that_cannot_be_is_told(page):
    opened(page, "?pin=0.3~2~0.8~0.6~free~lun~3~0|0.3~0.8|" + "0.3~0.8~0.8~0.6~free~lun~3~7")
    expect(page.locator("#pinned tbody tr").nth(0)).to_contain_text("restitution e = 2")
    expect(page.locator("#pinned tbody tr").nth(1)).to_contain_text("left out")
    expect(page.locator("#pinned tbody tr").nth(2)).to_contain_text("there is no such flow")
    expect(page.locator("#profile-nu .line")).to_have_count(3)


@pytest.mark.slow
def test_what_was_measured_is_drawn_behind_the_flows(page):
    profile = {"z": [0.5, 1.5, 2.5], "value": [0.4, 0.3, 0.2], "error": [0.02, 0.02, 0.02]}
    numbers = {"Q": {"value": 4.0, "error": 0.1}, "h": {"value": 3.0, "error": None}}
    given = {"slope": 0.31, "e": 0.8}
    run = {"name": "<own> run", "what": "particle run", "profiles": {"nu": profile}, "numbers": numbers, "given": given}
    other = {"name": "other", "what": "measurements", "profiles": {}, "numbers": {"Q": numbers["Q"]}, "given": {}}
    about = page.request.get("/about").json() | {"data": [run, other]}
    page.route("**/about", lambda route: route.fulfill(json=about))
    opened(page)
    expect(page.locator("#data li")).to_have_count(2)
    expect(page.locator("#data li").nth(0)).to_contain_text("<own> run particle run; slope 0.31, e 0.8")
    expect(page.locator("#profile-nu .measured")).to_have_count(3)
    expect(page.locator("#profile-T .measured")).to_have_count(0)
    expect(page.locator("#curve .measured")).to_have_count(1)
    # Behind the lines: what comes first is painted first.
    order = (
        "[...document.querySelectorAll('#profile-nu .measured, #profile-nu .line')].map((e) => e.getAttribute('class'))"
    )
    assert page.evaluate(order) == ["measured"] * 3 + ["line"] * 3
    page.locator("#against").select_option("M")
    expect(page.locator("#curve .measured")).to_have_count(0)
    page.get_by_role("button", name="show the chute of <own> run").click()
    expect(page.locator("#slope")).to_have_value("0.31")
    expect(page.locator("#Q")).to_have_value("4")
    page.locator("#data input").nth(0).uncheck()
    expect(page.locator("#profile-nu .measured")).to_have_count(0)


MEASURED = b"z,nu,Q,h\n0.5,0.4,4,3\n1.5,0.3,,\n2.5,0.2,,\n"


@pytest.mark.slow
def test_measurements_are_loaded_from_a_file_by_hand_and_dropped(page, tmp_path):
    opened(page)
    own = {"name": "own.csv", "mimeType": "text/csv", "buffer": MEASURED}
    chooser = page.get_by_label("Load measurements")
    chooser.focus()
    with page.expect_file_chooser() as chosen:
        chooser.press("Space")
    chosen.value.set_files([own])
    expect(page.locator("#load-words")).to_have_text("1 measured flow is drawn.")
    expect(page.locator("#profile-nu .measured")).to_have_count(3)
    expect(page.locator("#curve .measured")).to_have_count(1)
    # What is wrong is told on a line, and the rest is drawn.
    chooser.set_input_files([{**own, "name": "bad.csv", "buffer": b"a,b\n1,2\n"}, {**own, "name": "other.csv"}])
    expect(page.locator("#load-words")).to_contain_text("1 measured flow is drawn. bad.csv: unknown column 'a'")
    expect(page.locator("#data li")).to_have_count(2)
    chooser.set_input_files([{**own, "name": "large.csv", "buffer": b"1" * 2_000_001}])
    expect(page.locator("#load-words")).to_contain_text("has more than 2 MB")
    # Or dropped anywhere.
    page.evaluate(
        """(text) => {
          const dataTransfer = new DataTransfer();
          dataTransfer.items.add(new File([text], "dropped.csv"));
          document.querySelector("main").dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true }));
        }""",
        MEASURED.decode(),
    )
    expect(page.locator("#data li")).to_have_count(3)
    # The page that needs no server has those that are shown.
    page.locator("#data input").nth(1).uncheck()
    with page.expect_download(timeout=100_000) as download:
        page.locator("[data-export=page-html]").click()
    path = tmp_path / "chuteflow.html"
    download.value.save_as(path)
    page.goto(path.as_uri())
    expect(page.locator("#data li")).to_have_count(2)
    expect(page.locator("#data li").nth(1)).to_contain_text("dropped")
    expect(page.locator("#profile-nu .measured")).to_have_count(6)
    assert page.locator(".served:visible").count() == 0


@pytest.mark.slow
def test_the_page_opens_with_the_chute_of_the_command_line_at_any_address(page):
    about = page.request.get("/about").json() | {"first": {"slope": 0.35, "Q": 2.0, "si": "1", "d": "2.0"}}
    page.route("**/about", lambda route: route.fulfill(json=about))
    opened(page)
    expect(page.locator("#slope")).to_have_value("0.35")
    expect(page.locator("#si")).to_be_checked()
    page.locator("#si").uncheck()
    page.wait_for_timeout(400)
    # What was changed is kept by the address, also where it is the usual.
    assert parse_qs(urlsplit(page.url).query, keep_blank_values=True)["si"] == [""]
    page.reload()
    expect(page.locator("#si")).not_to_be_checked()


@pytest.mark.slow
def test_the_map_follows_the_sliders_coarsely_and_is_fine_when_they_rest(page):
    def column(route):
        query = parse_qs(urlsplit(route.request.url).query)
        part = {"stops": [0.6 + 0.2 * place_of(route) ** 2], "values": [1, 2]}
        if "coarse" not in query and hold:
            held.append(route)
            return
        parts = dict.fromkeys(("most", "families", "interior", "density", "hot"), part)
        asked.append((query["e"][0], "coarse" in query))
        at = 0.05 + 0.65 * place_of(route)
        route.fulfill(json={"outer": "slope", "inner": "roughness", "at": at, "parts": parts, "tolerance": 0.01})

    asked, held, hold = [], [], False
    page.unroute("**/ask/map?*")
    page.route("**/ask/map?*", column)
    opened(page)
    key = page.locator("#map-key")
    expect(key).to_contain_text("Drag the cross-hair to another chute.")
    expect(key).not_to_contain_text("Drawing")
    assert ("0.8", True) not in asked
    page.locator("#map").scroll_into_view_if_needed()
    page.wait_for_timeout(100)
    hold = True
    page.locator("#e-slider").press("ArrowRight")
    expect(key).to_contain_text("Coarse, until the sliders rest.")
    assert asked.count(("0.8005", True)) == 9 or asked.count(("0.801", True)) == 9
    hold = False
    for route in held:
        column(route)
    expect(key).not_to_contain_text("Coarse")
    # The line between columns is a smooth curve: its corners, of a parabola here, turn by little.
    turns = page.evaluate(
        """() => {
        const text = document.querySelectorAll('#map g > path[fill]')[1].getAttribute('d');
        const points = text.match(/[\\d.]+ [\\d.]+/g).map((pair) => pair.split(' ').map(Number));
        const line = points.slice(0, points.length / 2);
        const angles = line.slice(1).map(([x, y], i) => Math.atan2(y - line[i][1], x - line[i][0]));
        return angles.slice(1).map((angle, i) => Math.abs(angle - angles[i]));
    }"""
    )
    assert len(turns) > 40
    assert sorted(turns)[-3] < 0.12


@pytest.mark.slow
def test_the_three_flows_are_told_step_by_step(page):
    opened(page, "?slope=0.31&roughness=0.61")
    page.locator("#story-begin").click()
    for number, count, chosen in ((1, 3, 0), (2, 3, 0), (3, 3, 1), (4, 3, 2), (5, 1, 0), (6, 1, 0)):
        expect(page.locator("#story-place")).to_have_text(f"step {number} of 6")
        expect(page.locator("#flows label")).to_have_count(count)
        expect(page.locator("#flows input").nth(chosen)).to_be_checked()
        if number < 6:
            page.locator("#story-next").click()
    # What is said of the steps holds: which flow is left, and how they are ordered.
    expect(page.locator("#flows label")).to_contain_text("cold, dense, shallow")
    page.locator("#story-back").click()
    expect(page.locator("#flows label")).to_contain_text("hot, dilute, deep")
    page.locator("#story-back").click()
    expect(page.locator("#flows label").nth(2)).to_contain_text("density inverted")
    page.locator("#undo").click()
    expect(page.locator("#story-place")).to_have_text("step 5 of 6")
    page.locator("#story-end").click()
    expect(page.locator("#story")).to_be_hidden()


@pytest.mark.slow
def test_a_small_curve_stays_in_view(page):
    opened(page)
    expect(page.locator("#mini")).to_be_hidden()
    page.locator("#take-panel").scroll_into_view_if_needed()
    expect(page.locator("#mini .dot")).to_have_count(3)
    page.locator("#Q").fill("6")
    page.locator("#Q").press("Enter")
    expect(page.locator("#mini .dot")).to_have_count(1)
    page.locator("h1").scroll_into_view_if_needed()
    expect(page.locator("#mini")).to_be_hidden()


@pytest.mark.slow
def test_the_sliders_fold_away_on_a_phone(page):
    page.set_viewport_size({"width": 390, "height": 800})
    opened(page)
    expect(page.locator("#slope-slider")).to_be_hidden()
    expect(page.locator("#folded")).to_have_text("tan θ 0.3, e 0.8, e_w 0.8, r 0.6, Q 3")
    page.locator("#take-panel").scroll_into_view_if_needed()
    expect(page.locator("#mini")).to_be_in_viewport()
    page.locator("#fold summary").click()
    expect(page.locator("#slope-slider")).to_be_in_viewport()
    expect(page.locator("#mini")).to_be_in_viewport()
    page.set_viewport_size({"width": 1280, "height": 800})
    expect(page.locator("#slope-slider")).to_be_visible()


@pytest.mark.slow
@pytest.mark.parametrize("width", [1280, 390])
def test_nothing_moves_that_one_has_not_moved(page, width):
    page.set_viewport_size({"width": width, "height": 800})
    page.add_init_script(
        """globalThis.shifts = [];
        new PerformanceObserver((list) => shifts.push(...list.getEntries().map((entry) => entry.value)))
            .observe({ type: 'layout-shift', buffered: true });"""
    )
    opened(page)
    # What comes late is the stability of the flows, and examined flows of the curve.
    page.wait_for_timeout(1500)
    sum_before = page.evaluate("shifts.reduce((sum, value) => sum + value, 0)")
    for place in range(380, 400, 4):
        page.evaluate(
            f"{{ const slider = document.querySelector('#slope-slider'); slider.value = {place};"
            "slider.dispatchEvent(new Event('input')); }"
        )
        page.wait_for_timeout(200)
    # 0.1 is what counts as good for a page; here it is while it opens, and again while a slider moves.
    assert sum_before < 0.1
    assert page.evaluate("shifts.reduce((sum, value) => sum + value, 0)") - sum_before < 0.1


@pytest.mark.slow
def test_a_touch_reads_a_chart(tab):
    context = tab.context.browser.new_context(base_url=tab.address, has_touch=True)
    page = context.new_page()
    opened(page, "?stability=")
    box = page.locator("#profile-T").bounding_box()
    page.touchscreen.tap(box["x"] + 60, box["y"] + 120)
    expect(page.locator("#profile-T .tip")).to_be_visible()
    expect(page.locator("#profile-nu .tip")).to_be_visible()
    context.close()


@pytest.mark.slow
def test_the_button_writes_a_page_that_needs_no_server(page, tmp_path):
    opened(page, "?slope=0.31&Q=5&si=1&d=2")
    with page.expect_download(timeout=100_000) as download:
        page.locator("[data-export=page-html]").click()
    assert download.value.suggested_filename == "chuteflow.html"
    path = tmp_path / "chuteflow.html"
    download.value.save_as(path)
    assert 100_000 < path.stat().st_size < 2_000_000
    page.goto(path.as_uri())
    expect(page.locator("#says")).to_contain_text("Three flows share the flux Q = 3.42")
    expect(page.locator("#standalone-words")).to_contain_text(
        "grains: diameter 0.002 m, density 2500 kg/m^3", ignore_case=True
    )
    assert page.locator(".served:visible").count() == 0
    page.asked.clear()
