"""smc_mujoco: a MuJoCo benchmark suite for sliding-mode controllers.

    import smc_mujoco as smc

    scenario = smc.Scenario(plant="duffing", law=smc.law("observer_free", lam=6.0, k1=3.076))
    trace = smc.run(scenario)
    print(smc.score(trace))

Names are loaded when first used, so that importing the package costs nothing.
"""

import importlib
import sys
import types
from typing import TYPE_CHECKING

from smc_mujoco import gl, registration
from smc_mujoco.interrupts import held_back

if TYPE_CHECKING:
    from smc_mujoco import paper as paper
    from smc_mujoco.actuators import DCMotor as DCMotor
    from smc_mujoco.actuators import Lag as Lag
    from smc_mujoco.actuators import RateLimit as RateLimit
    from smc_mujoco.agents import agent as agent
    from smc_mujoco.backlash import Backlash as Backlash
    from smc_mujoco.basin import basin as basin
    from smc_mujoco.c.export import law_to_c as law_to_c
    from smc_mujoco.c.load import law_from_c as law_from_c
    from smc_mujoco.claims import Claim as Claim
    from smc_mujoco.claims import claims as claims
    from smc_mujoco.cli import play as play
    from smc_mujoco.component import GainWarning as GainWarning
    from smc_mujoco.conditions import Jump as Jump
    from smc_mujoco.conditions import Noise as Noise
    from smc_mujoco.contact import Contact as Contact
    from smc_mujoco.design import lqr as lqr
    from smc_mujoco.draw.figure import figure as figure
    from smc_mujoco.draw.video import clip as clip
    from smc_mujoco.draw.video import film as film
    from smc_mujoco.draw.video import still as still
    from smc_mujoco.errors import ScenarioError as ScenarioError
    from smc_mujoco.errors import ScenarioWarning as ScenarioWarning
    from smc_mujoco.estimators import estimator as estimator
    from smc_mujoco.estimators import estimator_function as estimator_function
    from smc_mujoco.estimators import estimators as estimators
    from smc_mujoco.friction import Coulomb as Coulomb
    from smc_mujoco.friction import LuGre as LuGre
    from smc_mujoco.friction import Viscous as Viscous
    from smc_mujoco.grids import grid as grid
    from smc_mujoco.initial_states import starts as starts
    from smc_mujoco.law import Law as Law
    from smc_mujoco.law import law as law
    from smc_mujoco.law import law_function as law_function
    from smc_mujoco.law import laws as laws
    from smc_mujoco.leaderboard import leaderboard as leaderboard
    from smc_mujoco.margins import margins as margins
    from smc_mujoco.mechanism import deviation as deviation
    from smc_mujoco.metrics import score as score
    from smc_mujoco.metrics import scores as scores
    from smc_mujoco.named_conditions import condition as condition
    from smc_mujoco.own_model import Channel as Channel
    from smc_mujoco.own_model import plant_from as plant_from
    from smc_mujoco.plant import Plant as Plant
    from smc_mujoco.plant import plant as plant
    from smc_mujoco.plant import plants as plants
    from smc_mujoco.policies import policy as policy
    from smc_mujoco.references import MinimumJerk as MinimumJerk
    from smc_mujoco.references import Ramp as Ramp
    from smc_mujoco.report import report as report
    from smc_mujoco.run import PlainLoopWarning as PlainLoopWarning
    from smc_mujoco.run import run as run
    from smc_mujoco.run import stream as stream
    from smc_mujoco.scenario import Scenario as Scenario
    from smc_mujoco.scene import Scene as Scene
    from smc_mujoco.sensors import Encoder as Encoder
    from smc_mujoco.series import TimeSeries as TimeSeries
    from smc_mujoco.signals import BandLimited as BandLimited
    from smc_mujoco.signals import Constant as Constant
    from smc_mujoco.signals import Gust as Gust
    from smc_mujoco.signals import Impulse as Impulse
    from smc_mujoco.signals import OrnsteinUhlenbeck as OrnsteinUhlenbeck
    from smc_mujoco.signals import Pulse as Pulse
    from smc_mujoco.signals import Signal as Signal
    from smc_mujoco.signals import Sine as Sine
    from smc_mujoco.signals import Step as Step
    from smc_mujoco.study import study as study
    from smc_mujoco.surfaces import Surface as Surface
    from smc_mujoco.surfaces import surface as surface
    from smc_mujoco.surfaces import surface_function as surface_function
    from smc_mujoco.surfaces import surfaces as surfaces
    from smc_mujoco.table import Table as Table
    from smc_mujoco.trace import Trace as Trace
    from smc_mujoco.trace import load as load
    from smc_mujoco.tuned import Tuned as Tuned
    from smc_mujoco.tuning import tune as tune

__version__ = "0.1.0"

_HOMES = {
    "actuators": ("DCMotor", "Lag", "RateLimit"),
    "agents": ("agent",),
    "backlash": ("Backlash",),
    "basin": ("basin",),
    "c.export": ("law_to_c",),
    "c.load": ("law_from_c",),
    "claims": ("Claim", "claims"),
    "cli": ("play",),
    "component": ("GainWarning",),
    "conditions": ("Jump", "Noise"),
    "contact": ("Contact",),
    "design": ("lqr",),
    "draw.figure": ("figure",),
    "draw.video": ("clip", "film", "still"),
    "errors": ("ScenarioError", "ScenarioWarning"),
    "estimators": ("estimator", "estimator_function", "estimators"),
    "friction": ("Coulomb", "LuGre", "Viscous"),
    "grids": ("grid",),
    "initial_states": ("starts",),
    "law": ("Law", "law", "law_function", "laws"),
    "leaderboard": ("leaderboard",),
    "margins": ("margins",),
    "mechanism": ("deviation",),
    "metrics": ("score", "scores"),
    "named_conditions": ("condition",),
    "own_model": ("Channel", "plant_from"),
    "paper": ("paper",),
    "plant": ("Plant", "plant", "plants"),
    "policies": ("policy",),
    "references": ("MinimumJerk", "Ramp"),
    "report": ("report",),
    "run": ("PlainLoopWarning", "run", "stream"),
    "scenario": ("Scenario",),
    "scene": ("Scene",),
    "sensors": ("Encoder",),
    "series": ("TimeSeries",),
    "signals": ("BandLimited", "Constant", "Gust", "Impulse", "OrnsteinUhlenbeck", "Pulse", "Signal", "Sine", "Step"),
    "study": ("study",),
    "surfaces": ("Surface", "surface", "surface_function", "surfaces"),
    "table": ("Table",),
    "trace": ("Trace", "load"),
    "tuned": ("Tuned",),
    "tuning": ("tune",),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}
__all__ = list(_HOME)  # pyright: ignore[reportUnsupportedDunderAll]  # it knows the imports above

gl.choose()  # before anything imports mujoco


class _Package(types.ModuleType):
    """Keeps public names from being hidden by submodules of the same name, such as law and run."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOME and isinstance(value, types.ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    with held_back():
        module = importlib.import_module(f"{__name__}.{_HOME[name]}")
    value = module if name == _HOME[name] == "paper" else getattr(module, name)
    value = globals()[name] = importlib.import_module(f"{__name__}.arguments").explained(value)
    return value


def __dir__() -> list[str]:
    return sorted({*_HOME, "__doc__", "__version__"})


registration.attend()  # gymnasium.make("smc_mujoco:Duffing-v0") imports this package, and expects it to be known then
