"""`smc.view` in a real browser: the page shows the machine, its runs go on. It needs MuJoCo 4, Chromium, playwright."""

import io
import shutil
import threading
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import smc_mujoco as smc

pytestmark = pytest.mark.slow
pytest.importorskip("mujoco.studio", reason="MuJoCo 3 has no Studio")
sync = pytest.importorskip("playwright.sync_api")
BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
SWITCHES = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
ROOT = Path(__file__).parents[2]
PORT = 8123


def quadrotor():
    return smc.plant_from(ROOT / "examples/quadrotor.xml", channels=["body"], keyframe="hover")


@pytest.mark.skipif(BROWSER is None, reason="no Chromium: apt-get install chromium")
@pytest.mark.parametrize(
    ("machine", "laws"),
    [(lambda: "duffing", ["super_twisting", "pid"]), (lambda: "pendulum_network", ["classical"]), (quadrotor, [])],
    ids=["two laws", "network", "quadrotor"],
)
def test_a_browser_shows_the_machine(machine, laws):
    done, pictures = threading.Event(), []

    def look():
        try:
            with sync.sync_playwright() as play:
                page = play.chromium.launch(executable_path=BROWSER, args=SWITCHES).new_page()
                page.goto(f"http://127.0.0.1:{PORT}/")
                page.wait_for_timeout(8000)
                pictures.append(np.asarray(Image.open(io.BytesIO(page.screenshot()))).astype(int))
        finally:
            done.set()

    def watched(session):
        if not started:
            started.append(session)
            browser.start()
        return not done.is_set()

    started, browser = [], threading.Thread(target=look)
    smc.view(machine(), laws, port=PORT, open_browser=False, watched=watched)
    browser.join()
    assert started[0].time > 1.0
    assert not started[0].message
    assert pictures[0].std() > 20  # not one colour
