"""smc-mujoco view SCENE: a run in MuJoCo's viewer, live."""

import os
import sys
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import loading, mendable


@mendable()
def view(
    name: options.SceneName,
    condition: Annotated[
        str | None, typer.Option(help="Which of the scene's conditions; default: the one that its film shows.")
    ] = None,
    label: Annotated[
        str | None, typer.Option(help="Which run of that condition, by its label; default: the first.")
    ] = None,
) -> None:
    """Watch one run of a scene in MuJoCo's viewer, in real time, and change the gains of its law.

    - Pause and go on: the space bar.
    - Change a gain: its slider gain:NAME in the panel "Control" at the right. It reaches from a tenth of the scene's
      value to ten times that value. Changed gains are printed, as code that makes the law.
    - Push a body: double-click it, hold Ctrl, and drag with the right mouse button.
    - Start again: Backspace. The run also starts again by itself when its duration is over. Changed gains are kept.

    The run is the one that `run` simulates, one simulation in Python. All other sliders and settings of the viewer
    change the picture only.

    Example: smc-mujoco view inverted_pendulum --label super_twisting
    """
    from smc_mujoco.common.errors import ScenarioError, find
    from smc_mujoco.draw import display

    no_window = display.missing()
    if sys.platform == "linux" and not no_window:
        os.environ["MUJOCO_GL"] = "glfw"  # one library for all windows
    with loading():
        from smc_mujoco.draw import viewer
        from smc_mujoco.studies import scene as scenes

    scene = scenes.read(scenes.find(name))
    runs = scene.conditions[scene.film]
    if condition is not None:
        runs = find(f"condition of {name}", condition, scene.conditions)
    scenario = next(iter(runs.values())) if label is None else find(f"label in {name}", label, runs)
    if no_window:
        raise ScenarioError(no_window)
    viewer.watch(scenario)
