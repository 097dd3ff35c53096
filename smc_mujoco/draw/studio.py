"""`smc.view`: any machine in MuJoCo's Studio, in a browser tab, stepped by the compiled loop of
`smc.run`.

Studio shows copies of the runs' positions, so nothing in its panels changes a run but the panel
"Laws", the push of the mouse and Reset. Its page runs in a thread of its own, which only asks: the
loop of `show` acts between two frames.
"""

# pyright: reportMissingImports=false
# (MuJoCo 3, which the lock has, lacks Studio)
import contextlib
import dataclasses
import importlib.util
import os
import shutil
import tempfile
import time
import types
import webbrowser
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.control.law import Law
from smc_mujoco.draw.session import Session, law_for, laws_of
from smc_mujoco.draw.studio_door import SCRIPT, Door
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.grid import listed_laws
from smc_mujoco.simulation.scenario import Scenario

FRAME_TIME = 1.0 / 60.0  # s
MAX_FRAME_TIME = 0.1  # s, simulated in a frame at most, so that slow runs still answer
# Where a processor draws the page, each pixel takes 0.4 us of it. So it has fewer along each side:
# chosen, as decimal points are lost at 0.5.
FEWER_PIXELS = """<head><script>{
  const gl = document.createElement("canvas").getContext("webgl2");
  const names = gl?.getExtension("WEBGL_debug_renderer_info");
  const renderer = names ? gl.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
  if (/swiftshader|llvmpipe|basic render/i.test(renderer))
    Object.defineProperty(window, "devicePixelRatio", { value: 0.6 });
}</script>"""


def view(
    scenario: Scenario | Sequence[Scenario] | Plant | str,
    laws: Sequence[Law | str] = (),
    port: int = 0,
    open_browser: bool = True,
) -> tuple[Scenario, ...]:
    """Show a machine under one law or two in a browser tab until Ctrl-C; return its scenarios as
    they are then.

        smc.view("inverted_pendulum", ["pid", "adrc"])

    The second law's machine is the transparent one. The panel "Laws" has the laws, their gains,
    what acts on the runs, u, s and e, and "save as scene". Double-click a body, hold Ctrl and drag
    with the right mouse button: it is pushed when you let go. The tab needs MuJoCo 4.0.1, which
    is not on the package index yet. Only this
    machine can open its address, which holds a secret word; keep it to yourself.

    Args:
      scenario: a Scenario or two, a plant, or "arm.xml:shoulder+elbow".
      laws: one or two; default the scenario's, or the first that suits the plant.
      port: of the page on this machine; 0 takes the first free one from 8080 on.
      open_browser: whether to open the tab.

    Returns:
      The scenarios, with the laws, gains and conditions that the tab last had.

    Raises:
      ScenarioError: MuJoCo is older than 4.0.1, this process had a view already, or a law does not
        suit the machine.
    """
    _check_studio()
    runs = runs_of(scenario, laws)
    from mujoco.studio import app, launch_web, viewer_protocol, web_viewer
    from mujoco.studio.web import web_server

    from smc_mujoco.draw.studio_panel import StudioPanel

    if hasattr(web_server.bind_public_socket, "__self__"):
        raise ScenarioError("no view: Studio crashes if a process opens it twice: restart Python")
    door = Door(web_server)
    door.bind("", port)
    print(f"{door.address} answers once the laws are compiled, in up to 20 s", flush=True)
    session = Session(runs)
    _serve_at(door, web_server, web_viewer)
    config = viewer_protocol.ViewerConfig(
        title="smc_mujoco", gfx="web", http_port=port, open_browser=open_browser
    )
    panel = StudioPanel(session)
    # without what is of a simulation that is not ours
    shell = app.App(app.Config(show_options=False, show_inspector=False))
    with tempfile.TemporaryDirectory() as folder, contextlib.suppress(KeyboardInterrupt):
        put_page(Path(web_server.__file__).parent / "dist", Path(folder))
        with launch_web.launch(config, plugins=[shell, panel]) as page:
            show(session, page, panel)
    return session.scenarios


def _check_studio() -> None:
    """Raise ScenarioError if MuJoCo has no Studio."""
    if importlib.util.find_spec("mujoco.studio") is None:
        raise ScenarioError(
            f"no view: MuJoCo {mujoco.__version__} has no Studio: it comes with MuJoCo 4.0.1, "
            "which is not on the package index yet"
        )


def _serve_at(door: Door, web_server: Any, web_viewer: Any) -> None:
    """Let Studio's modules serve their page at a door, and open its address."""
    web_server.bind_public_socket = door.bind
    web_server.bind_loopback_socket = door.bind_inner
    web_server.serve = door.serve
    web_viewer._print_url_banner = lambda host, port: print("compiled", flush=True)
    web_viewer.webbrowser = types.SimpleNamespace(
        open=lambda url, new: webbrowser.open(door.address, new)
    )


def put_page(original: Path, folder: Path) -> None:
    """Let Studio serve a copy of its page that has `FEWER_PIXELS` and asks at the door."""
    shutil.copytree(original, folder, dirs_exist_ok=True)
    page = folder / "index.html"
    page.write_text(
        page.read_text(encoding="utf-8").replace("<head>", FEWER_PIXELS + SCRIPT, 1),
        encoding="utf-8",
    )
    os.environ["MUJOCO_WEB_VIEWER_DIST"] = str(folder)


def runs_of(
    scenario: Scenario | Sequence[Scenario] | Plant | str, laws: Sequence[Law | str]
) -> list[Scenario]:
    """Return the scenarios to show."""
    named_laws = listed_laws(laws) if laws else []
    if isinstance(scenario, Scenario):
        runs = [scenario]
    else:
        runs = scenario
    if isinstance(runs, list | tuple):
        if not runs or not all(isinstance(run, Scenario) for run in runs):
            raise ScenarioError(
                f"scenario is {shown(scenario)}: give a Scenario or two, or a plant"
            )
        first = runs[0]
        of_laws = []
        for law in named_laws:
            own = law_for(first.plant, law)
            of_laws.append(dataclasses.replace(first, law=own))
        runs = of_laws or list(runs)
    else:
        plant = as_plant(runs)
        runs = []
        for law in named_laws or laws_of(plant)[:1]:
            own = law_for(plant, law)
            runs.append(Scenario(plant=plant, law=own))
    if len(runs) > 2:
        raise ScenarioError(
            f"{len(runs)} runs to show: give one or two, which are shown in one picture"
        )
    return runs


def show(session: Session, page: Any, panel: Any) -> None:
    """Show frame after frame: what was asked for, the push, a reset, the runs' next part."""
    model = session.screen()
    data = mujoco.MjData(model)
    page.set_model(model, data=data)
    before = time.perf_counter()
    pull = np.zeros((model.nbody, 3))
    while page.is_running():
        now = time.perf_counter()
        while not panel.asked.empty():
            try:
                panel.asked.get()()
            except (ScenarioError, OSError) as error:
                session.message = str(error)
        if not session.paused:
            session.advance(min(now - before, MAX_FRAME_TIME))
        before = now
        data.time = session.time
        data.qpos[:], data.qvel[:], data.act[:] = session.state(0)
        if len(session.scenarios) > 1:
            panel.ghost_at = session.state(1)[0].copy()
        before_sync = data.time
        page.sync(model, data)
        if data.time == 0.0 < before_sync:  # Studio's Reset
            session.reset()
            pull[:] = data.xfrc_applied[:] = 0.0
        pulled = data.xfrc_applied[:, :3].copy()
        if np.any(pull) and not np.any(pulled):  # the mouse let go
            sizes = np.abs(pull).sum(axis=1)
            body = int(np.argmax(sizes))
            name = model.body(body).name
            session.push(name, pull[body])
        pull = pulled
        rest = now + FRAME_TIME - time.perf_counter()
        time.sleep(max(0.0, rest))
