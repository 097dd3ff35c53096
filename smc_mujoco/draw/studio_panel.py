"""The panel "Laws" of `smc.view`, and the second run's machine.

It runs in the thread of Studio's page.
"""

# pyright: reportMissingImports=false
# (MuJoCo 3, which the lock has, lacks Studio)
import functools
import queue
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
from mujoco.studio import messages, plugin
from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco.studio.implot import implot

from smc_mujoco.draw.session import Session, laws_of

GHOST = 0.35  # opacity of the second run's machine
GEOMS = 2000  # of the second run's machine, at most
SAMPLES = 200  # of a curve: each goes to the browser in each frame
SAVED_AS = Path("view.py")


class StudioPanel(plugin.ViewerPlugin):
    """Shows a session, and puts what the user asks for into `asked`."""

    def __init__(self, session: Session):
        self.session = session
        self.asked: queue.Queue[Callable[[], object]] = queue.Queue()
        self.laws = laws_of(session.first[0].plant)
        self.ghost: mujoco.MjvScene | None = None
        self.ghost_at: np.ndarray | None = None  # positions of the second run

    @messages.handler
    def on_start(self, event: plugin.ViewerInitEvent) -> None:
        """Draw without haze, which takes a quarter of a frame where a processor draws."""
        flags = list(event.viewer.render_flags.flags)
        flags[mujoco.mjtRndFlag.mjRND_HAZE] = 0
        event.viewer.render_flags.flags = flags

    @messages.handler
    def on_gui(self, event: messages.BuildGuiEvent) -> None:
        """Build the panel of this frame."""
        session = self.session
        imgui.SetNextWindowPos(imgui.Vec2(8.0, 32.0), imgui.Cond.FirstUseEver)
        imgui.SetNextWindowSize(imgui.Vec2(420.0, 620.0), imgui.Cond.FirstUseEver)
        if imgui.Begin("Laws")[0]:
            imgui.Text(f"{session.time:.2f} s {session.message}")
            self.button("pause" if not session.paused else "go on", session.pause)
            imgui.SameLine()
            self.button("reset", session.reset)
            imgui.SameLine()
            self.button(f"save as scene {SAVED_AS}", functools.partial(session.save, SAVED_AS))
            for run in range(len(session.scenarios)):
                self.run(run)
            if len(session.scenarios) == 1:
                self.button("a second law", session.add)
            self.curves()
        imgui.End()
        if self.ghost_at is not None:
            self.draw_ghost()

    def button(self, words: str, ask: Callable[[], object]) -> None:
        """Show a button that asks for something."""
        if imgui.Button(words):
            self.asked.put(ask)

    def run(self, run: int) -> None:
        """Show the law of a run, and its sliders."""
        law = self.session.scenarios[run].law.name
        if law in self.laws:
            names = self.laws
        else:
            names = [law, *self.laws]
        changed, chosen = imgui.Combo(f"law {run + 1}", names.index(law), names)
        if changed:
            call = functools.partial(self.session.take_law, names[chosen], run)
            self.asked.put(call)
        for name, slider in self.session.sliders[run].items():
            changed, value = imgui.SliderFloat(
                f"{name}##{run}", slider.value, slider.low, slider.high, "%.4g"
            )
            if changed:
                call = functools.partial(self.session.move, run, slider, value)
                self.asked.put(call)

    def curves(self) -> None:
        """Show u, s and e of each run's first channel up to now; of a free body, those along the
        vertical.
        """
        for name in ("u", "s", "e"):
            implot.SetNextAxesToFit()
            if implot.BeginPlot(name, imgui.Vec2(-1.0, 130.0)):
                for run, scenario in enumerate(self.session.scenarios):
                    column = 2 if scenario.plant.pose else 0
                    log = self.session.log(run)[:, column]
                    step = max(1, len(log) // SAMPLES)
                    log = log[::step]
                    if name == "e":
                        values = log["x"] - log["r"]
                    else:
                        values = log[name]
                    implot.PlotLine(
                        f"{scenario.law.name}##{run}",
                        np.linspace(0.0, self.session.time, len(log)).tolist(),
                        values.tolist(),
                    )
                implot.EndPlot()

    def draw_ghost(self) -> None:
        """Draw the second run's machine, transparent, into the first's picture."""
        model = self.viewer.model
        ghost = self.ghost = self.ghost or mujoco.MjvScene(model, GEOMS)
        data = mujoco.MjData(model)
        data.qpos[:] = self.ghost_at
        mujoco.mj_forward(model, data)
        dynamic = mujoco.mjtCatBit.mjCAT_DYNAMIC.value
        mujoco.mjv_updateScene(
            model, data, mujoco.MjvOption(), None, mujoco.MjvCamera(), dynamic, ghost
        )
        geoms = [ghost.geoms[i] for i in range(ghost.ngeom)]
        for geom in geoms:
            geom.rgba[3] = GHOST
        self.viewer.extra_geoms[:] = geoms
