"""`smc-mujoco view` in a real browser: the page shows the machine.

It needs MuJoCo 4, Chromium, playwright.
"""

import io
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

pytestmark = pytest.mark.slow
pytest.importorskip("mujoco.studio", reason="MuJoCo 3 has no Studio")
sync = pytest.importorskip("playwright.sync_api")
BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
SWITCHES = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]


@pytest.mark.skipif(BROWSER is None, reason="no Chromium: apt-get install chromium")
@pytest.mark.parametrize(
    ("port", "words"),
    [
        (8123, "duffing --law super_twisting,pid"),
        (8124, "pendulum_network"),
        (8125, "examples/quadrotor.xml:body@hover"),
    ],
)
def test_a_browser_shows_the_machine(port, words):
    command = [
        sys.executable,
        "-m",
        "smc_mujoco",
        "view",
        *words.split(),
        "--port",
        str(port),
        "--no-browser",
    ]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as view:
        try:
            assert view.stdout
            while "Model changed" not in (line := view.stdout.readline()):
                assert line, "the view ended before it showed a model"
            with sync.sync_playwright() as play:
                page = play.chromium.launch(executable_path=BROWSER, args=SWITCHES).new_page()
                page.goto(f"http://127.0.0.1:{port}/")
                page.wait_for_timeout(8000)
                fewer = page.evaluate("document.getElementById('canvas').width / innerWidth")
                picture = np.asarray(Image.open(io.BytesIO(page.screenshot()))).astype(int)
        finally:
            view.send_signal(signal.SIGINT)
            said = view.communicate(timeout=30)[0]
    assert view.returncode == 0, said
    assert "Traceback" not in said
    assert picture.std() > 20  # not one colour
    assert fewer == 0.6  # a processor draws
