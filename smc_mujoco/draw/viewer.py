"""A run in MuJoCo's viewer in real time, controlled by the reference loop, with a slider for each gain of its law.

The viewer shows a second model, which has the sliders and copies its positions from the run. So the run equals that of
`smc.run`, whatever the viewer's panels change in the model on screen. Three things act on the run: the gains, the push
of the mouse, and the viewer's reset, which restarts it.
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
from smc_mujoco.mechanisms.hardware.part import joints
from smc_mujoco.mechanisms.plant import compiled_for_runs, field_array
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.callback import installed
from smc_mujoco.simulation.reference import Loop
from smc_mujoco.simulation.scenario import Scenario, stepped_by_mujoco

GAIN = "gain:"  # prefix of the sliders' names
SPACE_KEY = 32  # code of the key in GLFW
FRAME_TIME = 1.0 / 60.0  # s, of most screens
MAX_FRAME_TIME = 0.1  # s, longest time that a frame simulates and takes, so that slow runs still respond to the mouse


def watch(scenario: Scenario) -> None:
    """Show a run in MuJoCo's viewer until its window is closed; it restarts when its duration is over."""
    import mujoco.viewer

    live, others = Live(scenario), set(threading.enumerate())
    try:
        with mujoco.viewer.launch_passive(live.model, live.data, key_callback=live.key, show_left_ui=False) as window:
            with window.lock():
                aim(live.model, live.data, window.cam)
            play(live, window)
    finally:
        for thread in set(threading.enumerate()) - others:  # a process that ends while they draw crashes
            thread.join(timeout=10.0)
        print(as_code(live.law))


def play(live: "Live", window: Any) -> None:
    """Show frame after frame until the window is closed."""
    before = time.perf_counter()
    while window.is_running():
        now = time.perf_counter()
        with contextlib.suppress(mujoco.UnexpectedError):  # raised if the window is closed during a frame
            live.frame(window, now - before)
        before = now
        time.sleep(max(0.0, now + FRAME_TIME - time.perf_counter()))


def aim(model: mujoco.MjModel, data: mujoco.MjData, cam: mujoco.MjvCamera) -> None:
    """Put the viewer's camera, which the mouse moves, at the plant's camera `look`, if it has one."""
    look = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, "look")
    if look < 0:
        return
    place, ahead = data.cam_xpos[look], -data.cam_xmat[look].reshape(3, 3)[:, 2]
    cam.distance = float(ahead @ (model.stat.center - place))
    cam.lookat[:] = place + cam.distance * ahead
    cam.azimuth, cam.elevation = np.degrees([np.arctan2(ahead[1], ahead[0]), np.arcsin(ahead[2])])


class Live:
    """A run of a `scenario`, `loop`, of which `step` physics steps are over; `model` and `data` are those on screen."""

    def __init__(self, scenario: Scenario, say: Callable[[str], None] = print):
        self.model = model_with_sliders(scenario)
        self.data = mujoco.MjData(self.model)
        ids = [self.model.actuator(GAIN + name).id for name in slider_gains(scenario.law)]
        self.sliders = self.model.actuator_ctrladr[ids] if ids else np.zeros(0, int)
        self.limits = self.model.actuator_ctrlrange[self.sliders].T  # a row per control, as some actuators have none
        self.paused, self.say = False, say
        self.begin(scenario)
        self.show()

    @property
    def law(self) -> Law:
        """The law with its present gains."""
        return self.scenario.law

    def begin(self, scenario: Scenario) -> None:
        """Start the run again."""
        with installed():
            self.scenario = stepped_by_mujoco(scenario)  # whose friction feels the push, too
            base = models.compile_model(self.scenario, models.USERDATA)  # with the bodies that are on screen
            self.loop = Pushed(self.scenario, models.Mechanism(base, models.channels(base)))
        self.step, self.due, self.late = 0, 0.0, False
        self.build(0)

    def build(self, step: int) -> None:
        """Give the model on screen the true parameters that hold from a physics step on."""
        for name, value in models.field_values(self.loop.base, self.loop.scenario, step).items():
            field_array(self.model, name)[: len(value)] = value  # sliders are the last actuators
        mujoco.mj_setConst(self.model, mujoco.MjData(self.model))

    def key(self, code: int) -> None:
        """Pause or resume on the space bar: the viewer's key callback."""
        if code == SPACE_KEY:
            self.paused = not self.paused

    def frame(self, viewer: Any, seconds: float) -> None:
        """Make one frame: read the user's input, advance the run by `seconds`, show it."""
        self.listen()
        if not self.paused:
            self.advance(seconds)
        self.show()
        state = "paused" if self.paused else "slower than real time" if self.late else ""
        viewer.set_texts((None, None, "time\nlaw", f"{self.data.time:.1f} s {state}\n{self.law.name}"))
        viewer.sync()

    def listen(self) -> None:
        """Read the gains, the mouse's push and a reset from the viewer."""
        if self.data.time == 0.0 and self.step:  # a reset, which also puts the sliders to 0
            self.begin(self.scenario)
            return
        self.loop.push[:] = self.data.xfrc_applied
        values = np.clip(self.data.ctrl[self.sliders], *self.limits).tolist()
        gains = dict(self.law.gains) | dict(zip(slider_gains(self.law), values, strict=True))
        if gains != dict(self.law.gains):
            self.scenario = dataclasses.replace(self.scenario, law=dataclasses.replace(self.law, gains=gains))
            self.loop.controller.set_gains(self.law)

    def advance(self, seconds: float) -> None:
        """Simulate the time that is due, at most MAX_FRAME_TIME. Restart a finished run, pause a failed one."""
        if self.loop.failure or self.step > self.loop.total:
            self.begin(self.scenario)
        loop, h = self.loop, self.loop.scenario.physics_step
        self.due += min(seconds, MAX_FRAME_TIME)
        until, self.late = time.perf_counter() + MAX_FRAME_TIME, seconds > MAX_FRAME_TIME
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
            self.say(f"{loop.failure}, at t = {loop.failed_step * h:.6g} s: space starts again")

    def show(self) -> None:
        """Copy the run's state and gains to the model on screen; for a failed run the state before the failure."""
        seen, run = self.data, self.loop.data
        if not self.loop.failure:
            seen.time, seen.qpos[:], seen.qvel[:], seen.act[:] = run.time, run.qpos, run.qvel, run.act
            seen.ctrl[: len(run.ctrl)] = run.ctrl
        seen.ctrl[self.sliders] = list(slider_gains(self.law).values())
        seen.xfrc_applied[:] = 0.0
        mujoco.mj_forward(self.model, seen)


class Pushed(Loop):
    """The reference loop with an additional force and torque on every body, (nbody, 6), as in xfrc_applied."""

    def __init__(self, scenario: Scenario, mechanism: models.Mechanism):
        super().__init__(scenario, mechanism)
        self.push = np.zeros_like(self.data.xfrc_applied)

    def apply_disturbances(self, data: mujoco.MjData, t: float) -> np.ndarray:
        """Apply the disturbances and the push to the bodies. Return the disturbances without the push."""
        data.xfrc_applied[:] = 0.0
        d = super().apply_disturbances(data, t)
        data.xfrc_applied += self.push
        return d


def model_with_sliders(scenario: Scenario) -> mujoco.MjModel:
    """Return the mechanism with a slider for each gain: an actuator of gear 0, which moves nothing."""
    spec = models.spec(scenario)
    joint = joints(spec)[0].name
    for name, gain in slider_gains(scenario.law).items():
        spec.add_actuator(
            name=GAIN + name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            target=joint,
            gear=[0.0] * 6,
            ctrllimited=True,
            ctrlrange=slider_range(gain),
        )
    return compiled_for_runs(spec, 0)


def slider_gains(law: Law) -> dict[str, float]:
    """Return the gains that have sliders: all finite ones with one number for all channels."""
    return {name: gain for name, gain in law.gains.items() if not isinstance(gain, tuple) and math.isfinite(gain)}


def slider_range(gain: float) -> list[float]:
    """Return a slider's range: a tenth to ten times its gain; 0 to 1 for 0, as negative ones may be invalid."""
    return sorted((gain / 10.0, gain * 10.0)) if gain else [0.0, 1.0]


def as_code(law: Law) -> str:
    """Return a law as the code that makes it."""
    return f"smc.{law!r}" if law.name in catalogue() else str(law)
