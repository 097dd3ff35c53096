"""The panel of the page of `smc.view`: what a person changes, and the charts.

What a person asks for is done between two frames: `ask` takes it with a key, and of those with one
key only the last is done.
"""

from collections.abc import Callable, Hashable
from pathlib import Path

import numpy as np
from viser import GuiApi, GuiEvent, GuiSliderHandle, GuiUplotHandle, uplot

from smc_mujoco.common import html
from smc_mujoco.common.aliases import Array
from smc_mujoco.draw import shared_axes, wording
from smc_mujoco.draw.session import Session, laws_of
from smc_mujoco.draw.view_machine import Machines, not_shown
from smc_mujoco.mechanisms.layout import channel_names
from smc_mujoco.metrics.conventions import groups
from smc_mujoco.simulation.doubts import constant_goal

SAVED_AS = Path("view.py")
STEPS = 500  # of a slider
MAX_SAMPLES = 200  # of a curve
CHARTS = {"x": "position x", "u": "control u", "s": "sliding variable s"}
CHART_HEIGHT = 105  # px
AXES = tuple(  # along t and up: px from a number to the next at least, and px for the numbers
    uplot.Axis(space=space, size=size, ticks=uplot.Axis_Ticks(show=False))
    for space, size in ((50.0, 24.0), (18.0, 50.0))
)
PREFIXES = ((1e-5, 1e6, "µ"), (0.01, 1e3, "m"))  # of units: for what is below, and times what
LINE = 2.0  # px
DASHES = ((), (8.0, 4.0))  # of the first run's lines and the second's, px
Ask = Callable[[Hashable, Callable[[], object]], None]


class ViewPanel:
    """The panel of a session, whose `rebuild` makes the page anew."""

    def __init__(
        self,
        gui: GuiApi,
        session: Session,
        machines: Machines,
        ask: Ask,
        rebuild: Callable[[], None],
    ):
        self.gui = gui
        self.session = session
        self.machines = machines
        self.ask = ask
        self.rebuild = rebuild
        self.sliders: list[dict[str, GuiSliderHandle]] = []
        self.status = gui.add_html("")
        if words := not_shown(machines.model):
            gui.add_html(said(words))
        self.buttons()
        names = channel_names(session.scenarios[0].plant)
        run = session.scenarios[0].resolved
        way = np.abs(np.subtract(run.x0, constant_goal(run) or run.plant.origin))
        longest = int(way[: run.plant.driven].argmax())
        self.channel = 2 if run.plant.pose else longest  # of what flies, its height
        if len(names) > 1:
            channel_choice = gui.add_dropdown("charts of", names, initial_value=names[self.channel])
            channel_choice.on_update(
                lambda _: self.ask("chart", lambda: self.chart(names, channel_choice.value))
            )
        self.charts = {name: self.add_chart(name) for name in CHARTS}
        tabs = gui.add_tab_group()
        for run, scenario in enumerate(session.scenarios):
            with tabs.add_tab(f"{run + 1}: {wording.law_name(scenario.law)}"):
                self.add_law(run)
        if len(session.scenarios) == 1:
            self.button("a second law", self.add_run)
        self.button(f"save as scene {SAVED_AS}", lambda: session.save(SAVED_AS))
        self.say()

    def buttons(self) -> None:
        """Add what stops, begins again and pushes."""
        session = self.session
        actions = {
            "pause": session.pause,
            "reset": self.reset,
            "push": lambda: self.machines.push(self.force.value),
        }
        group = self.gui.add_button_group("run", tuple(actions))
        group.on_click(lambda _: self.ask("run", actions[group.value]))
        weight = self.machines.weight
        self.force = self.gui.add_slider(
            "push, N", 0.0, 2.0 * weight, 2.0 * weight / STEPS, 0.5 * weight
        )
        if len(session.scenarios) > 1:
            beside = self.gui.add_checkbox("beside each other", initial_value=True)
            beside.on_update(
                lambda _: self.ask("beside", lambda: self.machines.stand(beside.value))
            )

    def button(self, words: str, call: Callable[[], object]) -> None:
        """Add a button that asks for something."""
        self.gui.add_button(words, color="gray").on_click(lambda _: self.ask(words, call))

    def add_law(self, run: int) -> None:
        """Add the law of a run, and its sliders."""
        law = self.session.scenarios[run].law.name
        names = sorted({law, *laws_of(self.session.first[0].plant)})
        choice = self.gui.add_dropdown("law", names, initial_value=law)
        choice.on_update(
            lambda event: self.ask(("law", run), lambda: self.take_law(run, choice.value))
        )
        handles = {}
        for name, slider in self.session.sliders[run].items():
            low = min(slider.low, slider.value)
            high = max(slider.high, slider.value)
            step = (high - low) / STEPS
            handles[name] = self.gui.add_slider(name, low, high, step, slider.value)
            handles[name].on_update(self.moved(run, name, handles[name]))
        self.sliders.append(handles)

    def moved(self, run: int, name: str, handle: GuiSliderHandle) -> Callable[[GuiEvent], None]:
        """Return what a slider asks for."""

        def move() -> None:
            self.session.move(run, self.session.sliders[run][name], handle.value)
            if self.session.message:  # it was refused
                handle.value = self.session.sliders[run][name].value

        return lambda event: event.client and self.ask((run, name), move)

    def take_law(self, run: int, name: str) -> None:
        """Give a run another law."""
        self.session.take_law(name, run)
        self.rebuild()

    def reset(self) -> None:
        """Begin again with the first scenarios."""
        self.session.reset()
        self.rebuild()

    def add_run(self) -> None:
        """Show the run twice."""
        self.session.add()
        self.rebuild()

    def chart(self, names: tuple[str, ...], name: str) -> None:
        """Show the signals of another channel, from the next curves on."""
        self.channel = names.index(name)

    def title(self, signal: str, prefix: str = "") -> str:
        """Return the title of a chart, with its unit."""
        for group in groups(self.session.scenarios[0]):
            if self.channel in group.channels:
                return f"{CHARTS[signal]} ({prefix}{shared_axes.units(group)[signal]})"
        return CHARTS[signal]

    def add_chart(self, signal: str) -> GuiUplotHandle:
        """Add the chart of a signal of all runs."""
        series = [uplot.Series(label="t (s)")]
        for colour, dash, scenario in zip(
            self.machines.colours, DASHES, self.session.scenarios, strict=False
        ):
            name = wording.law_name(scenario.law)
            series.append(uplot.Series(label=name, stroke=colour, width=LINE, dash=dash))
        start = tuple(np.zeros(2) for _ in series)
        return self.gui.add_uplot(
            start,
            tuple(series),
            title=self.title(signal),
            scales={"x": uplot.Scale(time=False, range=(0.0, self.session.scenarios[0].duration))},
            axes=AXES,
            legend=uplot.Legend(show=False),
            height=CHART_HEIGHT,
            padding=(8, 24, 0, 0),
        )

    def curve(self, turn: int) -> None:
        """Draw the runs up to now in one chart, in turn: a browser draws slower than we step."""
        signal, chart = list(self.charts.items())[turn % len(self.charts)]
        logs = []
        for run in range(len(self.session.scenarios)):
            log = self.session.log(run)
            logs.append(log[:: max(1, len(log) // MAX_SAMPLES), self.channel])
        if len(logs[0]) < 2:
            return
        t = np.linspace(0.0, self.session.time, len(logs[0]))
        curves = [held(log[signal]) for log in logs]
        peak = np.max(np.abs(curves))
        small = ((times, prefix) for most, times, prefix in PREFIXES if 0.0 < peak < most)
        times, prefix = next(small, (1.0, ""))
        chart.data = (t, *(times * curve for curve in curves))
        if chart.title != (title := self.title(signal, prefix)):
            chart.title = title

    def say(self) -> None:
        """Say what the time is, and what could not be done."""
        words = f"{self.session.time:.1f} s"
        if self.session.paused:
            words += ", paused"
        self.status.content = said(f"<b>{words}</b> {html.text(self.session.message)}")


def said(text: str) -> str:
    """Return words of the panel as HTML."""
    return f'<div style="padding: 0 1em; font-size: 14px">{text}</div>'


def held(signal: Array) -> Array:
    """Return a signal that keeps its last finite value where a run has failed."""
    last = np.maximum.accumulate(np.where(np.isfinite(signal), np.arange(len(signal)), 0))
    return np.ascontiguousarray(signal[last])
