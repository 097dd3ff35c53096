"""smc_mujoco: a MuJoCo benchmark suite for sliding-mode controllers.

    import smc_mujoco as smc

    scenario = smc.Scenario(plant="duffing", law=smc.law("observer_free", lam=6.0, k1=3.076))
    trace = smc.run(scenario)
    print(smc.score(trace))

A plant is a name of `smc.plants()`, or your own MJCF with the joints to control.
`smc.which("arm.xml:shoulder,elbow", starts=smc.starts(x0=0.3))` tunes laws on it and says which to
take.

The names by task, those of a first script first; `help(smc.run)` tells what a name does:

    Run and look: Scenario, run, Trace, load, score, figure, plot, film, show, view
    Laws: law, laws, law_function, law_from
    Plants: plant, plants, plant_from, plant_from_steps, Channel
    Conditions: condition, starts, Noise, Constant, Step, Sine, Coulomb, Viscous, Encoder,
        Backlash, DCMotor, Lag, Stops, Wall, Ball, Feedforward
    Compare: compare, which, tune, margins, grid, study, leaderboard, Table
    More to run and to look at: stream, scores, Scene, play, ScenarioError
    Surfaces, estimators, policies: surface, estimator, estimator_function, policy
    Signals and time: Signal, Jump, Fault, Clock
    Analyse: worst_case, sensitivity, Uncertainty
    Machines: rig, rigs, identify, identify_friction, measured
    Papers: audit, claims
    Benchmark: problem, results

What is needed less often is in modules: `smc.signals` (pushes, paths, gusts, series),
`smc.hardware` (more friction, servos), `smc.design` (gains from theory, chattering, regions of
attraction, what to record), `smc.accuracy` (orders, half steps), `smc.metrics` (of joints and
tips), `smc.exchange` (laws from and to C and FMUs), `smc.envs` (environments for agents),
`smc.errors` (warnings) and `smc.paper`. In pytest the fixture `step_response` tests a law:
`help("smc_mujoco.testing")`.

`__init__.pyi` has the modules of the names. A name is loaded when it is first used, so that
importing the package costs nothing. Types that are only returned are in their modules, such as
smc_mujoco.analysis.tuning.result.Tuned.
"""

from smc_mujoco.common import lazy
from smc_mujoco.common.version import __version__ as __version__
from smc_mujoco.envs import registration

_LAZY = lazy.lazy_module(__name__)
__getattr__ = _LAZY.getattr
__dir__ = _LAZY.dir
__all__ = list(_LAZY.origins)

registration.register_when_imported()
