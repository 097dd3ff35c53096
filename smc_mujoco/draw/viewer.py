"""A run in MuJoCo's viewer at real time: the reference loop's control, with a slider for each gain of its law.

What is shown is a model of its own, which has the sliders and takes positions from the run. So the run is that of
`smc.run`, whatever the viewer's panels do to what is shown. Three things go the other way: the gains, what the mouse
pushes with, and the viewer's reset, which begins the run anew.
"""

import contextlib
import dataclasses
import math
import threading
import time
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.control.law import Law, catalogue
from smc_mujoco.mechanisms.hardware.part import driven
from smc_mujoco.mechanisms.plant import array, ready
from smc_mujoco.simulation import model as assembly
from smc_mujoco.simulation.callback import installed
from smc_mujoco.simulation.reference import Loop
from smc_mujoco.simulation.scenario import Scenario

GAIN = "gain:"  # what names of sliders begin with
SPACE = 32  # GLFW's code of the key
FRAME = 1.0 / 60.0  # s, of most screens
MOST = 0.1  # s that a frame simulates, or takes to: what is slower than real time still answers the mouse
REST = 30  # frames without a change after which gains are printed: half a second


def watch(scenario: Scenario) -> None:
    """Show a run in MuJoCo's viewer until its window is closed; it begins anew when its duration is over."""
    import mujoco.viewer

    live, others = Live(scenario), set(threading.enumerate())
    try:
        with mujoco.viewer.launch_passive(live.model, live.data, key_callback=live.key, show_left_ui=False) as window:
            with window.lock():
                aim(live.model, live.data, window.cam)
            play(live, window)
    finally:
        for thread in set(threading.enumerate()) - others:  # a process that ends while it draws crashes
            thread.join(timeout=10.0)
        print(called(live.law))


def play(live: "Live", window: Any) -> None:
    """Show frame after frame until the window is closed."""
    before = time.perf_counter()
    while window.is_running():
        now = time.perf_counter()
        with contextlib.suppress(mujoco.UnexpectedError):  # what it says when closed in mid-frame
            live.frame(window, now - before)
        before = now
        time.sleep(max(0.0, now + FRAME - time.perf_counter()))


def aim(model: mujoco.MjModel, data: mujoco.MjData, cam: mujoco.MjvCamera) -> None:
    """Let the viewer's camera, which the mouse moves, begin where the plant's own `look` stands, if it has one."""
    look = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, "look")
    if look < 0:
        return
    place, ahead = data.cam_xpos[look], -data.cam_xmat[look].reshape(3, 3)[:, 2]
    cam.distance = float(ahead @ (model.stat.center - place))
    cam.lookat[:] = place + cam.distance * ahead
    cam.azimuth, cam.elevation = np.degrees([np.arctan2(ahead[1], ahead[0]), np.arcsin(ahead[2])])


class Live:
    """A run that a viewer shows, frame by frame.

    Attributes:
      loop: the run; of its duration `step` physics steps are over.
      model, data: what the viewer shows.
      paused: whether time stands still.
    """

    def __init__(self, scenario: Scenario, say: Callable[[str], None] = print):
        self.model = slidden(scenario)
        self.data = mujoco.MjData(self.model)
        ids = [self.model.actuator(GAIN + name).id for name in turned(scenario.law)]
        self.sliders = self.model.actuator_ctrladr[ids] if ids else np.zeros(0, int)
        self.limits = self.model.actuator_ctrlrange[self.sliders].T  # a row a control: some actuators take none
        self.paused, self.say, self.told, self.rested = False, say, scenario.law, 0
        self.begin(scenario)
        self.show()

    @property
    def law(self) -> Law:
        """The law with its gains of now."""
        return self.loop.scenario.law

    def begin(self, scenario: Scenario) -> None:
        """Begin anew."""
        with installed():
            self.loop = Pushed(scenario)
        self.step, self.due, self.late = 0, 0.0, False
        self.build(0)

    def build(self, step: int) -> None:
        """Show the mechanism with the true parameters that hold from a physics step on."""
        for name, value in assembly.numbers(self.loop.compiled, self.loop.scenario, step).items():
            array(self.model, name)[: len(value)] = value  # sliders are the last actuators
        mujoco.mj_setConst(self.model, mujoco.MjData(self.model))

    def key(self, code: int) -> None:
        """The viewer's key callback: space stops time, and lets it go on."""
        if code == SPACE:
            self.paused = not self.paused

    def frame(self, viewer: Any, seconds: float) -> None:
        """One frame: what the user did, that many seconds of the run, and how it then looks."""
        self.listen()
        if not self.paused:
            self.advance(seconds)
        self.show()
        state = "paused" if self.paused else "slower than real time" if self.late else ""
        viewer.set_texts((None, None, "time\nlaw", f"{self.data.time:.1f} s {state}\n{self.law.name}"))
        viewer.sync()

    def listen(self) -> None:
        """Take from the viewer the gains, what the mouse pushes with, and a reset."""
        if self.data.time == 0.0 and self.step:  # a reset, which puts the sliders to 0, too
            self.begin(self.loop.scenario)
            return
        self.loop.push[:] = self.data.xfrc_applied
        values = np.clip(self.data.ctrl[self.sliders], *self.limits).tolist()
        gains = dict(self.law.gains) | dict(zip(turned(self.law), values, strict=True))
        self.rested += 1
        if gains != dict(self.law.gains):
            law = dataclasses.replace(self.law, gains=gains)
            self.loop.scenario, self.rested = dataclasses.replace(self.loop.scenario, law=law), 0
        elif self.rested >= REST and self.told != self.law:
            self.told = self.law
            self.say(called(self.law))

    def advance(self, seconds: float) -> None:
        """Simulate what is due, at most MOST; a run that is over begins anew, one that fails is paused."""
        if self.loop.failure or self.step > self.loop.total:
            self.begin(self.loop.scenario)
        loop, h = self.loop, self.loop.scenario.physics_step
        self.due += min(seconds, MOST)
        until, self.late = time.perf_counter() + MOST, seconds > MOST
        with installed(loop.control), np.errstate(all="ignore"):
            while self.due >= h and self.step <= loop.total and not loop.failure:
                loop.step(self.step)
                self.step, self.due = self.step + 1, self.due - h
                if time.perf_counter() > until:
                    self.due, self.late = 0.0, True
        if self.step > loop.scenario.jump_step >= 0:
            self.build(loop.scenario.jump_step)
        if loop.failure:
            self.paused = True
            self.say(f"{loop.failure}, at t = {loop.failed_step * h:.6g} s: space begins anew")

    def show(self) -> None:
        """Put the run's state and gains into what the viewer shows; of a run that failed the last one before."""
        seen, run = self.data, self.loop.data
        if not self.loop.failure:
            seen.time, seen.qpos[:], seen.qvel[:], seen.act[:] = run.time, run.qpos, run.qvel, run.act
            seen.ctrl[: len(run.ctrl)] = run.ctrl
        seen.ctrl[self.sliders] = list(turned(self.law).values())
        seen.xfrc_applied[:] = 0.0
        mujoco.mj_forward(self.model, seen)


class Pushed(Loop):
    """The reference loop with a force and a torque on every body besides, (nbody, 6), as xfrc_applied has them."""

    def __init__(self, scenario: Scenario):
        super().__init__(scenario)
        self.push = np.zeros_like(self.data.xfrc_applied)

    def disturb(self, data: mujoco.MjData, t: float) -> np.ndarray:
        """The disturbances alone; the push is added to them on the bodies."""
        data.xfrc_applied[:] = 0.0
        d = super().disturb(data, t)
        data.xfrc_applied += self.push
        return d


def slidden(scenario: Scenario) -> mujoco.MjModel:
    """The mechanism with a slider a gain among the viewer's controls: an actuator of gear 0, which moves nothing."""
    spec = assembly.spec([scenario])
    joint = driven(spec)[0].name
    for name, gain in turned(scenario.law).items():
        spec.add_actuator(
            name=GAIN + name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            target=joint,
            gear=[0.0] * 6,
            ctrllimited=True,
            ctrlrange=reach(gain),
        )
    return ready(spec, 0)


def turned(law: Law) -> dict[str, float]:
    """The gains that have sliders: all that are finite."""
    return {name: gain for name, gain in law.gains.items() if math.isfinite(gain)}


def reach(gain: float) -> list[float]:
    """A slider's range: a decade either side of its gain; 0 to 1 of a gain of 0, which may have to be positive."""
    return sorted((gain / 10.0, gain * 10.0)) if gain else [0.0, 1.0]


def called(law: Law) -> str:
    """A law as code that makes it."""
    return f"smc.{law!r}" if law.name in catalogue() else str(law)
