"""`smc-mujoco view` in a real browser: the page shows the machine.

It needs MuJoCo 4.0.1, Chromium, playwright.
"""

import io
import re
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
# What a page of another origin gets that somehow knows the address.
FOREIGN = """async address => {
  const socket = new WebSocket(address.replace("http", "ws") + "state?sid=other");
  const opened = await new Promise(done => {
    socket.onopen = () => done("open");
    socket.onerror = () => done("closed");
  });
  const got = await fetch(address + "model").then(answer => answer.status, () => "nothing");
  return [opened, got];
}"""


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
            before = ""
            while "Model changed" not in (line := view.stdout.readline()):
                assert line, "the view ended before it showed a model"
                before += line
            (address,) = re.findall(rf"http://127.0.0.1:{port}/\S+/", before)
            with sync.sync_playwright() as play:
                browser = play.chromium.launch(executable_path=BROWSER, args=SWITCHES)
                page = browser.new_page()
                page.goto(address)
                page.wait_for_timeout(8000)
                foreign_page = browser.new_page()
                without = foreign_page.goto(f"http://127.0.0.1:{port}/").status
                foreign_page.goto("data:text/html,<p>other</p>")
                knows = foreign_page.evaluate(FOREIGN, address)
                fewer = page.evaluate("document.getElementById('canvas').width / innerWidth")
                picture = np.asarray(Image.open(io.BytesIO(page.screenshot()))).astype(int)
        finally:
            view.send_signal(signal.SIGINT)
            said = view.communicate(timeout=30)[0]
    assert view.returncode == 0, said
    assert "Traceback" not in said
    assert picture.std() > 20  # not one colour
    assert without == 403
    assert knows in (["closed", 403], ["closed", "nothing"])
    assert fewer == 0.6  # a processor draws
