"""The live page in a browser: it loads offline and says nothing, its traces are those of `smc.run`, keys, sliders and
links work, and it fits a phone.

The browser is Chromium (Debian, Ubuntu: apt-get install chromium); without it these tests are skipped.
"""

import functools
import gzip
import http.server
import io
import re
import shutil
import threading

import numpy as np
import pytest
from helpers.live import farthest, packages, scenario
from PIL import Image

import smc_mujoco as smc
from smc_mujoco.draw import style
from smc_mujoco.exchange.live.build import DEFAULT_PLANTS
from smc_mujoco.mechanisms.plants import van_der_pol

pytestmark = pytest.mark.slow

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
SWITCHES = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--enable-unsafe-swiftshader"]
PHONE = {"width": 390, "height": 844}
MOST = 6e6  # bytes of the page of three plants, compressed


@smc.law_function(gains={"lam": 6.0, "k1": 3.0})
def my_law(y, gains, memory):
    s = y.de + gains.k1 * y.e
    return -gains.lam * s / (1.0 + abs(s)), s


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    packages()
    return smc.live(laws=[my_law], out=tmp_path_factory.mktemp("live") / "page").parent


@pytest.fixture(scope="module")
def address(folder):
    """The page on a plain web server, as a static host serves it."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, format, *args):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(folder))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


@pytest.fixture(scope="module")
def browser():
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        pytest.skip("no Chromium to open the live page in: apt-get install chromium")
    sync = pytest.importorskip("playwright.sync_api")
    with sync.sync_playwright() as play:
        opened = play.chromium.launch(executable_path=path, args=SWITCHES)
        yield opened
        opened.close()


LONGEST_FRAME = 100  # samples that the page simulates in a frame of 0.1 s or more
# Five frames a second: without a GPU, drawing takes most of these tests' time.
FEW_FRAMES = "window.requestAnimationFrame = (f) => setTimeout(() => f(performance.now()), 200)"


class Seen:
    """The page in a browser that reaches its server and nothing else, with all that it said and asked for."""

    def __init__(self, browser, address):
        self.said, self.asked, self.address, self.opened = [], [], address, 0
        self.page = browser.new_page(viewport={"width": 900, "height": 700})
        self.page.add_init_script(FEW_FRAMES)
        self.page.on("console", lambda m: self.said.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.route(
            lambda url: not url.startswith((address, "data:", "blob:")),
            lambda route: route.abort("internetdisconnected"),
        )
        self.page.goto(address)
        self.page.wait_for_selector("html[data-ready]", timeout=60_000)

    def open(self, setting):
        """Follow a link to a setting, in the page that is loaded already."""
        self.opened += 1
        self.page.evaluate("setting => { location.hash = setting; }", f"{setting}&link={self.opened}")
        self.page.wait_for_function("live.running()[0].simulation.time < 1")

    def drawn(self):
        """Wait until the page has drawn a frame that began after this call."""
        self.page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def time(self) -> float:
        """Simulated time, s."""
        return self.page.evaluate("live.running()[0].simulation.time")

    def chosen(self, part) -> object:
        """A part of the first simulation's scenario."""
        return self.page.evaluate(f"live.running()[0].simulation.s.{part}")

    def law_gain(self, name) -> float:
        """A gain of the first law."""
        return self.page.evaluate(f"live.running()[0].simulation.law.gains.{name}")


@pytest.fixture(scope="module")
def seen(browser, address):
    return Seen(browser, address)


@pytest.fixture
def page(seen):
    seen.open("plant=inverted_pendulum")
    return seen.page


def test_it_loads_without_network_and_says_nothing(seen):
    seen.page.wait_for_function("live.running()[0].simulation.time > 0.2", timeout=30_000)
    assert seen.said == []
    assert [url for url in seen.asked if not url.startswith((seen.address, "data:", "blob:"))] == []


def test_a_trace_in_the_page_is_that_of_run(seen):
    for chosen in (
        {"plant": "inverted_pendulum", "law": "observer_free", "input_delay": 0.002, "friction": 0.1},
        {  # with the tuned gains the last bit of x0 changes u by 0.04, with these by less than 1e-12
            "plant": "duffing",
            "law": "super_twisting",
            "gains": {"k1": 4.0, "k2": 6.0, "c": 3.0},
            "disturbance": {"amplitude": 0.3, "omega": 4.0},
        },
    ):
        found = seen.page.evaluate("chosen => live.trace(chosen, 5.0)", chosen)
        assert farthest(found, smc.run(scenario(chosen, 5.0))) < 1e-6


def test_a_law_of_the_user_runs_in_the_page_as_in_run(seen):
    chosen = {"plant": "duffing", "law": "my_law", "gains": {"lam": 5.0}}
    found = seen.page.evaluate("chosen => live.trace(chosen, 2.0)", chosen)
    trace = smc.run(smc.Scenario(plant="duffing", law=my_law(lam=5.0), duration=2.0))
    assert farthest(found, trace) < 1e-6
    assert seen.page.locator("#choice-a option[value=my_law]").count() == 1


def test_keys_pause_reset_and_push(seen, page):
    page.locator("#machines").focus()
    page.wait_for_function("live.running()[0].simulation.time > 0.3")
    page.keyboard.press("Space")
    paused = seen.time()
    seen.drawn()
    assert seen.time() == paused > 0.0
    page.keyboard.press("r")
    assert seen.time() == 0.0
    page.keyboard.down("ArrowRight")
    page.keyboard.press("Space")
    page.wait_for_function("live.running().every(({ simulation }) => simulation.push[0] > 0)")
    page.keyboard.up("ArrowRight")
    page.wait_for_function("live.running().every(({ simulation }) => simulation.push[0] === 0)")


def test_a_key_belongs_to_what_has_the_focus(seen, page):
    page.wait_for_function("live.running()[0].simulation.time > 0.3")
    page.locator("[data-exact=mass]").focus()
    page.keyboard.press("r")
    page.keyboard.press("Space")
    assert seen.time() > 0.3
    assert page.inner_text("#play .word") == "Pause"
    page.locator("#play").focus()
    page.keyboard.press("Space")  # the button's own, once
    assert page.inner_text("#play .word") == "Play"
    page.keyboard.press("r")
    assert seen.time() == 0.0
    page.keyboard.press("Space")


def test_the_mouse_pushes_one_machine(seen, page):
    page.locator("#machines").scroll_into_view_if_needed()
    box = page.locator("#machines").bounding_box()
    page.wait_for_function("live.running()[0].simulation.time > 0.9", timeout=60_000)  # it stands upright
    at = page.evaluate("live.onScreen(0, 'bob')")
    page.mouse.move(box["x"] + at[0], box["y"] + at[1])
    page.mouse.down()
    page.mouse.move(box["x"] + at[0] + 60, box["y"] + at[1])
    page.wait_for_function("Math.abs(live.running()[0].simulation.push[0]) > 0.1")
    assert page.evaluate("live.running()[0].simulation.push[0]") > 0.0  # to the right, where x grows
    assert page.evaluate("live.running()[1].simulation.push[0]") == 0.0
    page.mouse.up()
    page.wait_for_function("live.running()[0].simulation.push[0] === 0")


def test_a_slider_moves_its_condition_and_the_link_holds_it(seen, page):
    delay, gain = page.locator("[data-exact=delay]"), page.locator("#law-a [data-exact=k1]")
    delay.fill("7")
    delay.press("Enter")
    gain.fill("4.25")
    gain.press("Enter")
    slider = page.locator("[data-name=friction]")
    slider.focus()
    page.keyboard.press("ArrowRight")
    assert seen.chosen("input_delay") == pytest.approx(0.007)
    assert seen.law_gain("k1") == 4.25
    friction = seen.chosen("friction")
    assert friction > 0.0
    assert seen.chosen("physics_step") == 2.5e-4  # as in a scenario with friction
    setting = page.evaluate("location.hash")
    assert "a.k1=4.25" in setting
    seen.open("plant=duffing")
    assert seen.chosen("input_delay") == 0.0
    seen.open(setting.removeprefix("#"))
    assert (seen.chosen("input_delay"), seen.law_gain("k1"), seen.chosen("friction")) == (0.007, 4.25, friction)


def test_surface_estimator_and_encoder_are_choices_that_the_link_holds(seen, page):
    link = "plant=duffing&a=boundary_layer&a-surface=terminal&a-surface.b=3&b=classical&b-velocity=levant&counts=256"
    chosen = """live.running().map(({ simulation: { s, surface, velocity } }) =>
        [s.counts, surface?.name ?? null, surface?.gains.b ?? null, velocity.name])"""
    linked = [[256, "terminal", 3.0, "filtered_difference"], [256, None, None, "levant"]]
    seen.open(link)
    assert page.evaluate(chosen) == linked
    page.select_option("#surface-a", "linear")
    page.select_option("#counts", "0")
    page.select_option("#velocity-b", "measured")
    assert page.evaluate(chosen) == [[0, "linear", None, "measured"], [0, None, None, "measured"]]
    page.select_option("#surface-a", "terminal")
    slope = page.locator("#law-a [data-exact=b]")
    slope.fill("3")
    slope.press("Enter")
    page.select_option("#velocity-b", "levant")
    page.select_option("#counts", "256")
    setting = page.evaluate("location.hash").removeprefix("#")
    seen.open("plant=duffing")
    seen.open(setting)
    assert page.evaluate(chosen) == linked
    assert page.inner_text("#name-a") == "Boundary layer · terminal"
    assert seen.said == []


def test_a_link_with_nonsense_opens_the_page(seen):
    seen.open("plant=toString&a=classical&a.c=much&a.k=Infinity&delay=1e9&b=<script>")
    assert seen.page.input_value("#plant") == DEFAULT_PLANTS[0]
    assert seen.chosen("input_delay") == 0.05  # the slider's end
    assert seen.law_gain("k") == seen.page.evaluate("live.facts.plants.inverted_pendulum.ranges.classical.k[1]")
    assert seen.page.inner_text("#status") == (
        "This page does not have the plant “toString” and the law “<script>”, which the link names."
    )
    assert seen.said == []


def picture(page) -> np.ndarray:
    """The picture of the machines without the names that lie over them, (height, width, 3)."""
    names = page.locator(".name")
    names.evaluate_all("all => all.forEach(one => { one.style.visibility = 'hidden'; })")
    shot = Image.open(io.BytesIO(page.locator("#machines").screenshot())).convert("RGB")
    names.evaluate_all("all => all.forEach(one => { one.style.visibility = ''; })")
    return np.asarray(shot, float)


def coloured(page, colour) -> int:
    """The pixels of the machines with about the hue of a colour."""
    r, g, b = np.moveaxis(picture(page), -1, 0)
    wanted = np.array(style.rgb(colour), float)
    here = np.stack([r, g, b]) / np.maximum(np.linalg.norm([r, g, b], axis=0), 1.0)
    return int((np.tensordot(wanted / np.linalg.norm(wanted), here, 1) > 0.985).sum())


def test_springs_follow_the_cart(seen):
    seen.open("plant=van_der_pol")
    seen.page.wait_for_function("live.running()[0].simulation.time > 0.4")
    if seen.page.inner_text("#play .word") == "Pause":
        seen.page.locator("#play").click()
    seen.drawn()
    x = seen.page.evaluate("live.running()[0].simulation.data.qpos[0]")
    left, right = seen.page.evaluate(
        "live.stage.machines[0].skins.map(({ geometry: { attributes: { position: { array } } } }) =>"
        " array.filter((_, i) => i % 3 === 0)).map((x) => [Math.min(...x), Math.max(...x)])"
    )
    assert abs(x - smc.plant("van_der_pol").x0[0]) > 0.05
    assert left == pytest.approx([-van_der_pol.POST_END, x - van_der_pol.CART_END], abs=0.02)
    assert right == pytest.approx([x + van_der_pol.CART_END, van_der_pol.POST_END], abs=0.02)
    seen.page.locator("#play").click()


def test_an_arrow_points_where_u_pushes(seen):
    seen.open("plant=van_der_pol")
    seen.page.wait_for_function("live.stage.machines[0].u !== 0")
    seen.page.locator("#play").click()
    seen.drawn()
    mean, bound, shown, along = seen.page.evaluate(
        "[live.stage.machines[0]].map(({ u, simulation: { s }, force: { visible, children } }) =>"
        " [u, s.u_max, visible, children[0].matrixWorld.elements[4]])[0]"
    )
    law = seen.page.evaluate("live.running()[0].simulation.s.law")
    every = seen.page.evaluate(
        "([law, until]) => live.trace({ plant: 'van_der_pol', law }, until).u", [law, seen.time()]
    )
    seen.page.locator("#play").click()
    assert shown
    frame = every[-LONGEST_FRAME:]
    assert mean * bound == pytest.approx(np.mean(frame), abs=1e-9)
    assert max(frame) < -3.0  # it begins at x = 2
    assert along < -0.05  # m: the arrow's shaft along x


# The edges, from -1 to 1 across a wide and a high picture, of the first machine with the arrows of the largest u.
ARROWS = """[-1, 1].flatMap((u) => [{ width: 3, height: 1 }, { width: 1, height: 3 }].flatMap((part) => {
    const { stage, stage: { machines: [machine] } } = live;
    const kept = machine.u;
    machine.u = u;
    machine.pointForce();
    stage.open(part);
    machine.u = kept;
    return Object.values(machine.movingBounds(stage.camera));
}))"""


@pytest.mark.parametrize("plant", DEFAULT_PLANTS)
def test_a_picture_of_what_moves_is_the_whole_picture(seen, plant):
    """Without a GPU only the part of the picture in which something moves is drawn."""
    seen.open(f"plant={plant}")
    seen.page.wait_for_function("live.running()[0].simulation.time > 0.6")
    assert seen.page.evaluate("live.stage.slow && live.stage.machines[0].drawn !== null")
    arrow = "live.stage.machines[0].force.matrixWorld.elements.concat(live.stage.machines[0].force.children[1].scale.y)"
    assert np.isfinite(seen.page.evaluate(arrow)).all()
    seen.page.locator("#play").click()
    seen.drawn()
    drawn = picture(seen.page)
    seen.page.evaluate("live.stage.drawAll()")
    seen.drawn()
    again = picture(seen.page)
    edges = seen.page.evaluate(ARROWS)
    seen.page.locator("#play").click()
    assert np.abs(edges).max() < 1.0  # the arrows of the largest u are in the picture
    assert np.abs(drawn - again).max() == 0.0
    x, y = map(round, seen.page.evaluate("(({ x, y }) => [x, y])(live.stage.parts()[1])"))
    seam = again[20:-20, x - 1] if x else again[y - 1, 20:-20]  # the corners are round
    assert np.ptp(seam, axis=0).max() == 0.0  # nothing is left of the previous plant


def test_two_laws_have_the_colours_of_the_figures(seen, page):
    seen.open("plant=duffing&a=super_twisting&b=classical")
    shown = page.evaluate("live.running().map(({ colour }) => colour)")
    assert shown == [style.law_colour("super_twisting"), style.law_colour("classical")]
    page.select_option("#choice-b", "")
    assert page.evaluate("live.running().length") == 1
    assert page.inner_text("#name-a") == style.law_name("super_twisting")


def test_every_plant_and_law_can_be_chosen(seen, page):
    for plant in DEFAULT_PLANTS:
        page.select_option("#plant", plant)
        page.wait_for_function("live.running()[0].simulation.time > 0")
        assert coloured(page, style.law_colour("observer_free")) > 100, f"{plant} is not in the picture"
        for law in ("twisting", "lqr"):
            page.select_option("#choice-a", law)
            before = seen.time()
            page.wait_for_function(f"live.running()[0].simulation.time > {before}")
    assert seen.said == []


def test_every_control_has_a_name(page):
    nameless = page.eval_on_selector_all(
        "input, select, button, canvas",
        """all => all.filter(one => !(one.labels?.length || one.getAttribute('aria-label')
          || one.getAttribute('aria-labelledby') || one.textContent.trim())).map(one => one.outerHTML)""",
    )
    assert nameless == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_a_phone(seen, page, scheme):
    wide = page.viewport_size
    page.set_viewport_size(PHONE)
    page.emulate_media(color_scheme=scheme)
    seen.drawn()
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    paper = page.evaluate("getComputedStyle(document.body).backgroundColor")
    light = sum(map(int, re.findall(r"\d+", paper)[:3])) > 3 * 128
    assert light == (scheme == "light")
    assert page.locator("#machines").bounding_box()["height"] >= 250
    assert seen.said == []
    page.set_viewport_size(wide)
    page.emulate_media(color_scheme="light")


def test_the_page_of_three_plants_is_small(folder):
    sizes = {path.name: len(gzip.compress(path.read_bytes(), 6)) for path in folder.rglob("*") if path.is_file()}
    assert 1e6 < sum(sizes.values()) < MOST
