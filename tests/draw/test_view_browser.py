"""`smc-mujoco view` in a real browser: the page shows the machine, and a slider changes the run.

It needs Chromium, playwright.
"""

import io
import re
import runpy
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

import smc_mujoco as smc
from smc_mujoco.draw.view_panel import MAX_SAMPLES

pytestmark = pytest.mark.slow
pytest.importorskip("viser")
sync = pytest.importorskip("playwright.sync_api")
BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
SWITCHES = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
without_browser = pytest.mark.skipif(
    BROWSER is None, reason="no Chromium: apt-get install chromium"
)
ARM = """<mujoco><worldbody><geom type="plane" size="1 1 .1"/>
<body name="upper" pos="0 0 .3"><joint name="shoulder" axis="0 1 0" damping=".2"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" contype="0"/>
<body name="fore" pos=".3 0 0"><joint name="elbow" axis="0 1 0" damping=".1"/>
<geom type="capsule" fromto="0 0 0 .2 0 0" size=".02" contype="0"/></body></body></worldbody>
<actuator><motor joint="shoulder" ctrllimited="true" ctrlrange="-30 30"/>
<motor joint="elbow" ctrllimited="true" ctrlrange="-15 15"/></actuator></mujoco>"""
# the last values of the charts' curves
ENDS = "Object.values(window.__viserTestpoints.uplots).map(({chart}) => chart.data[1].at(-1))"
POSITION = "Object.values(window.__viserTestpoints.uplots)[0].chart.data.slice(0, 2).map(side => [...side])"
TIMES = "Object.values(window.__viserTestpoints.uplots).map(({chart}) => chart.data[0].at(-1))"


@pytest.fixture(scope="module")
def browser():
    """A browser that draws without a graphics card."""
    with sync.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=BROWSER, args=SWITCHES)
        yield browser
        browser.close()


def opened(browser, address):
    """A tab that shows a page, without the browser's notice that it draws slowly."""
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto(address)
    page.wait_for_selector("canvas")
    return page


def dark_share(page):
    """The share of dark pixels of a tab's scene, whose floor is white."""
    image = Image.open(io.BytesIO(page.screenshot())).convert("L")
    return float((np.asarray(image)[160:740, :880] < 180).mean())


@without_browser
@pytest.mark.parametrize(
    "words",
    ["inverted_pendulum --law pid,adrc", "arm.xml:shoulder+elbow --law pid", "quadrotor"],
)
def test_a_browser_shows_the_machine_and_a_slider_changes_the_run(
    words, browser, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.xml").write_text(ARM)
    command = [sys.executable, "-m", "smc_mujoco", "view", *words.split(), "--no-browser"]
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as view:
        try:
            assert view.stdout
            lines = iter(view.stdout.readline, "")
            said = next((line for line in lines if "http" in line), "")  # below warnings
            (address,) = re.findall(r"http://127\S+/", said)
            page = opened(browser, address)
            second = opened(browser, address)
            page.wait_for_function(f"{TIMES}.every(time => time > 0.5)")
            machine = dark_share(page)
            page.get_by_role("button", name="pause").click()
            second.get_by_text("paused").wait_for()
            second.close()
            before = page.evaluate(ENDS)
            number = page.locator("input[type=text][inputmode=decimal]").nth(1)  # 0: of the push
            gain = float(number.input_value())
            number.fill(str(2.0 * gain))
            number.press("Enter")
            page.wait_for_function(
                f"before => {ENDS}.every((end, i) => end !== before[i])", arg=before
            )
            changed = float(number.input_value())
            times, positions = page.evaluate(POSITION)
            page.get_by_role("button", name="save as scene").click()
            page.get_by_text("saved as view.py").wait_for()
            page.close()
        finally:
            view.send_signal(signal.SIGINT)
            said = view.communicate(timeout=60)[0]
    assert view.returncode == 0, said
    assert "Traceback" not in said
    assert machine > 5e-4
    assert changed == pytest.approx(2.0 * gain, rel=0.02)
    saved = next(iter(runpy.run_path(str(tmp_path / "view.py"))["RESTORED"].values()))
    repeated = smc.run(saved).x[:, 2 if saved.plant.pose else 0]
    stride = max(1, round(times[-1] / saved.control_period) // MAX_SAMPLES)
    assert np.array_equal(repeated[::stride][: len(positions)], positions)


@without_browser
def test_a_recording_plays_from_its_file(browser, tmp_path):
    command = [sys.executable, "-m", "smc_mujoco", "view", "duffing", "--record", "run.html"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    page = opened(browser, (tmp_path / "run.html").as_uri())
    requested = []
    page.on("request", lambda request: requested.append(request.url))
    page.wait_for_function("Number(document.querySelector('input').value) > 1")
    assert dark_share(page) > 5e-4
    assert not any(url.startswith("http") for url in requested)
