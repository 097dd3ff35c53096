"""smc_mujoco: a MuJoCo benchmark suite for sliding-mode controllers.

    import smc_mujoco as smc

    scenario = smc.Scenario(plant="duffing", law=smc.law("observer_free", lam=6.0, k1=3.076))
    trace = smc.run(scenario)
    print(smc.score(trace))

A plant is a name of `smc.plants()`, or your own MJCF with the joints to control. `smc.which("arm.xml:shoulder,elbow",
starts=smc.starts(x0=0.3))` tunes laws on it and says which to take.

The names by task, those of a first script first; `help(smc.run)` tells what a name does:

    Run and look: Scenario, run, Trace, load, score, figure, plot, film, still, show
    Laws: law, laws, law_function, Measurement
    Plants: plant, plants, plant_from, Channel
    Conditions: condition, starts, Noise, Constant, Step, Sine, Pulse, Coulomb, Viscous, Encoder, Backlash, DCMotor,
        Lag
    Compare: compare, which, tune, margins, grid, study, leaderboard, Table
    More to run and to look at: stream, scores, joint_scores, tip_scores, Scene, Outcome, play, clip, frames, live,
        choose_gl, ScenarioError, ScenarioWarning, GainWarning, PackageWarning, PlainLoopWarning
    Surfaces, estimators, design: surface, surfaces, surface_function, Surface, estimator, estimators,
        estimator_function, Law, joint_laws, lqr, policy, law_from_control, state_space, gains_for
    Machines: Plant, deviation, rig, rigs, Rig, identify, arms
    References, disturbances, time: Signal, Push, Ramp, MinimumJerk, Impulse, Gust, BandLimited, OrnsteinUhlenbeck,
        Relay, Waypoints, cartesian_path, TimeSeries, Held, Jump, Clock
    Real mechanisms: LuGre, Sigmoid, ServoFriction, servo, Contact, RateLimit
    Analyse: accuracy, basin, chattering, describing_function, step_halving, worst_case, Uncertainty
    Audit: audit, claims, certify, Certificate, report, boards, paper
    Exchange: law_to_c, law_from_c, export_fmu, law_from_fmu, agent, gym, suite, vector

`__init__.pyi` has the modules of the names. A name is loaded when it is first used, so that importing the package costs
nothing. Types that are only returned are in their modules, such as smc_mujoco.analysis.tuning.result.Tuned.
"""

import re
from pathlib import Path

from smc_mujoco.common import annexes
from smc_mujoco.common.interrupts import delay_ctrl_c
from smc_mujoco.common.version import __version__ as __version__
from smc_mujoco.envs import registration

_STUB = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_ORIGINS = {name: module for module, name in re.findall(r"^from (\S+) import (\w+) as \2$", _STUB, re.MULTILINE)}
_MODULES = {  # public modules; three of them need an extra
    "arms": "smc_mujoco.studies.arms",
    "boards": "smc_mujoco.evidence.boards",
    "gym": "smc_mujoco.envs.gymnasium_env",
    "paper": "smc_mujoco.evidence.papers.gaber.scenarios",
    "suite": "smc_mujoco.envs.dm_control_env",
    "vector": "smc_mujoco.envs.vector_env",
}
__all__ = [*_ORIGINS, "arms", "boards", "paper"]  # noqa: PLE0604  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    """Return a public function, class or module."""
    if name not in _ORIGINS and name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    with delay_ctrl_c():
        value = annexes.module(_MODULES.get(name) or _ORIGINS[name], f"smc.{name}")
    globals()[name] = value if name in _MODULES else getattr(value, name)
    return globals()[name]


def __dir__() -> list[str]:
    return sorted({*_ORIGINS, *_MODULES, "__doc__", "__version__"})


registration.register_when_imported()
