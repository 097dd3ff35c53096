"""`smc.view`: any machine in a browser tab, stepped by the compiled loop of `smc.run`."""

import contextlib
import dataclasses
import io
import itertools
import queue
import threading
import time
import webbrowser
from collections.abc import Callable, Hashable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from smc_mujoco.common import extras, html
from smc_mujoco.common.aliases import AnyPath, Array
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.files import with_ending, write_text
from smc_mujoco.control.law import Law
from smc_mujoco.draw import wording
from smc_mujoco.draw.session import Session, law_for, laws_of
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.grid import Starts, listed_laws
from smc_mujoco.simulation.scenario import Scenario

if TYPE_CHECKING:
    from viser import ClientHandle

FPS = 30.0
MAX_FRAME_TIME = 0.1  # s, simulated in a frame at most, so that slow runs still answer
FRAMES_A_CHART = 5  # frames from the drawing of one of the charts to that of the next
FIRST_PORT = 8080
HEIGHT = 640  # px, in a notebook


def view(
    scenario: Scenario | Sequence[Scenario] | Plant | str,
    laws: Sequence[Law | str] = (),
    port: int = 0,
    open_browser: bool = True,
    record: AnyPath | None = None,
) -> "LiveView":
    """Show a machine under one law or two in a browser tab until Ctrl-C, or in a notebook's cell.

        smc.view("inverted_pendulum", ["pid", "adrc"], record="run.html")

    The panel has the laws, their gains, what acts on the runs, charts of x, u and s, and "save as
    scene". Drag a part of the machine with the mouse: it is pushed when you let go. Drag beside the
    machine to turn the camera. Only this machine can open the page's address, which holds a secret
    word; keep it to yourself.

    Args:
      scenario: a Scenario or two, a plant, or "arm.xml:shoulder+elbow".
      laws: one or two; default the scenario's, or the first that suits the plant, if any does.
      port: of the page on this machine; 0 takes the first free one from 8080 on. One that is in use
        gives way to the next free one.
      open_browser: whether to open the tab.
      record: an .html file. The runs are written to it, and nothing is shown: any browser plays
        the file, without a server.

    Returns:
      The view. `view.scenarios` are those that the tab last had. In a notebook the cell shows it,
      and `view.close()` ends it.

    Raises:
      ScenarioError: the extra `view` is missing, a law does not suit the machine, or nothing that
        moves has a shape.
    """
    with extras.extra("view", "smc.view"):
        import fast_simplification  # noqa: F401
        import viser  # noqa: F401
    from smc_mujoco.draw.view_machine import not_shown

    path = None if record is None else with_ending(record, ".html")
    watched = LiveView(Session(runs_of(scenario, laws)), port)
    if words := not_shown(watched.machines.model):
        print(words)
    if path is not None:
        watched.record(path)
    elif html.in_notebook():
        watched.serve_beside()
        return watched
    else:
        print(f"{watched.address} (Ctrl-C ends it)", flush=True)
        if open_browser:
            webbrowser.open(watched.address)
        with contextlib.suppress(KeyboardInterrupt):
            watched.serve()
    watched.close()
    return watched


class LiveView:
    """A page that shows a session: what `smc.view` returns.

    `address` is that of the page, which holds its secret word.
    """

    def __init__(self, session: Session, port: int):
        from viser import ViserServer

        from smc_mujoco.draw.view_door import THIS_MACHINE, door, secret_path

        self.session = session
        self.asked: queue.SimpleQueue[tuple[Hashable, Callable[[], object]]] = queue.SimpleQueue()
        self.ended = threading.Event()
        self.thread: threading.Thread | None = None
        secret = secret_path()
        # viser prints an address without the secret word, which nobody can open
        with door(secret), contextlib.redirect_stdout(io.StringIO()):
            self.server = ViserServer(THIS_MACHINE, port or FIRST_PORT, verbose=False)
        self.address = f"http://{THIS_MACHINE}:{self.server.get_port()}{secret}/"
        try:
            self.rebuild()
        except BaseException:
            self.close()
            raise
        self.server.on_client_connect(self.fit)

    @property
    def scenarios(self) -> tuple[Scenario, ...]:
        """The runs, with the laws, gains and conditions that the page last had."""
        return self.session.scenarios

    def _repr_html_(self) -> str:
        style = f"width: 100%; height: {HEIGHT}px; border: none"
        return f'<iframe src="{self.address}" style="{style}"></iframe>'

    def rebuild(self) -> None:
        """Make the scene and the panel anew from the session."""
        from smc_mujoco.draw.view_machine import Machines
        from smc_mujoco.draw.view_panel import ViewPanel

        gui = self.server.gui
        with self.server.atomic():
            gui.reset()
            self.server.scene.reset()
            gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
            gui.set_panel_label(wording.plant_name(self.session.scenarios[0].plant))
            gui.main_panel.dock_right()
            self.machines = Machines(self.server, self.session, self.push)
            self.panel = ViewPanel(gui, self.session, self.machines, self.ask, self.rebuild)

    def fit(self, client: "ClientHandle") -> None:
        """Let a new tab see all machines."""
        self.machines.fit_to(client)

    def ask(self, key: Hashable, call: Callable[[], object]) -> None:
        """Take what a person asks for, which is done before the next frame."""
        self.asked.put((key, call))

    def push(self, body: str, force: Array) -> None:
        """Push a body from the next frame on."""
        self.ask("push", lambda: self.session.push(body, force))

    def answer(self) -> None:
        """Do what was asked for; of what has the same key the last."""
        calls = {}
        while not self.asked.empty():
            key, call = self.asked.get()
            calls[key] = call
        for call in calls.values():
            try:
                call()
            except (ScenarioError, OSError) as error:
                self.session.message = str(error)

    def serve(self) -> None:
        """Show frame after frame in real time, while a tab is open, until the view is closed."""
        before = time.perf_counter()
        for frame in itertools.count():
            began = time.perf_counter()
            self.answer()
            if self.server.get_clients() and not self.session.paused:
                self.session.advance(min(began - before, MAX_FRAME_TIME))
            before = began
            with self.server.atomic():
                self.machines.show()
            if frame % FRAMES_A_CHART == 0:
                self.panel.say()
                self.panel.curve(frame // FRAMES_A_CHART)
            if self.ended.wait(max(0.0, began + 1.0 / FPS - time.perf_counter())):
                return

    def serve_beside(self) -> None:
        """Serve in a thread, until the view is closed."""
        self.thread = threading.Thread(target=self.serve, daemon=True)
        self.thread.start()

    def close(self) -> None:
        """End the page, and the threads of its server."""
        self.ended.set()
        if self.thread is not None:
            self.thread.join()
        with contextlib.redirect_stdout(io.StringIO()):
            self.server.stop()

    def record(self, path: Path) -> None:
        """Write a page that plays the runs from their start to their end without a server."""
        from smc_mujoco.draw.view_door import with_less_work

        self.session.begin(self.session.scenarios)
        self.machines.show()
        recording = self.server.get_scene_serializer()
        while self.session.sample < self.session.samples:
            before = self.session.time
            self.session.advance(1.0 / FPS)
            recording.insert_sleep(self.session.time - before)
            self.machines.show()
        write_text(path, with_less_work(recording.as_html()))


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
        for law in named_laws or laws_of(plant)[:1] or ["none"]:
            own = law_for(plant, law)
            run = Scenario(plant=plant, law=own)
            # an arm that would rest at its goal begins beside it
            runs.append(Starts(spread=0.0).place(run, 0))
    if len(runs) > 2:
        raise ScenarioError(
            f"{len(runs)} runs to show: give one or two, which are shown in one picture"
        )
    return runs
