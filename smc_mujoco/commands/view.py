"""smc-mujoco view SCENE: a run in MuJoCo's viewer, live."""

import os
import sys
from typing import Annotated

import typer

from smc_mujoco.terminal import loading, mendable


def view(
    name: Annotated[str, typer.Argument(metavar="SCENE", help="A scene file, or the name of one that `list` shows.")],
    condition: Annotated[str | None, typer.Option(help="One of the scene's; default the one that it films.")] = None,
    label: Annotated[str | None, typer.Option(help="The run in it, by its label; default the first.")] = None,
) -> None:
    """Watch one run of a scene in MuJoCo's viewer, at real time, and turn the gains of its law.

    Space pauses. The sliders gain:NAME under Control, at the right, change the law's gains, from a tenth of the scene's
    to ten times; gains that you changed are printed, and those of the end. Double-click a body, then drag with Ctrl and
    the right button, to push it. Backspace, and the end of the run's duration, begin it anew with the gains of then.
    Other sliders and settings change the picture at most. It is the run that `run` makes, in the plain loop.

    Example: smc-mujoco view inverted_pendulum --label super_twisting
    """
    with mendable():
        from smc_mujoco import display
        from smc_mujoco.errors import ScenarioError, find

        if sentence := display.missing():
            raise ScenarioError(sentence)
        if sys.platform == "linux":
            os.environ["MUJOCO_GL"] = "glfw"  # one library for all windows
        with loading():
            from smc_mujoco import live
            from smc_mujoco import scene as scenes

        scene = scenes.read(scenes.find(name))
        runs = scene.conditions[scene.film]
        if condition is not None:
            runs = find(f"condition of {name}", condition, scene.conditions)
        scenario = next(iter(runs.values())) if label is None else find(f"label in {name}", label, runs)
        live.watch(scenario)
