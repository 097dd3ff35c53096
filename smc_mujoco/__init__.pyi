import smc_mujoco.studies.boards
from smc_mujoco.analysis.chattering import Chattering as Chattering
from smc_mujoco.analysis.chattering import chattering as chattering
from smc_mujoco.analysis.harmonics import describing_function as describing_function
from smc_mujoco.analysis.margins import margins as margins
from smc_mujoco.analysis.region_of_attraction import basin as basin
from smc_mujoco.analysis.tuning.result import Tuned as Tuned
from smc_mujoco.analysis.tuning.search import tune as tune
from smc_mujoco.cli.main import play as play
from smc_mujoco.common.errors import ScenarioError as ScenarioError
from smc_mujoco.common.errors import ScenarioWarning as ScenarioWarning
from smc_mujoco.common.gl import choose_gl as choose_gl
from smc_mujoco.control.c.export import law_to_c as law_to_c
from smc_mujoco.control.c.load import law_from_c as law_from_c
from smc_mujoco.control.component import GainWarning as GainWarning
from smc_mujoco.control.design import lqr as lqr
from smc_mujoco.control.estimator import estimator as estimator
from smc_mujoco.control.estimator import estimator_function as estimator_function
from smc_mujoco.control.estimator import estimators as estimators
from smc_mujoco.control.law import Law as Law
from smc_mujoco.control.law import law as law
from smc_mujoco.control.law import law_function as law_function
from smc_mujoco.control.law import laws as laws
from smc_mujoco.control.policy import policy as policy
from smc_mujoco.control.surface import Surface as Surface
from smc_mujoco.control.surface import surface as surface
from smc_mujoco.control.surface import surface_function as surface_function
from smc_mujoco.control.surface import surfaces as surfaces
from smc_mujoco.draw.board import plot as plot
from smc_mujoco.draw.figure import figure as figure
from smc_mujoco.draw.film.film import clip as clip
from smc_mujoco.draw.film.film import film as film
from smc_mujoco.draw.film.film import still as still
from smc_mujoco.draw.notebook import frames as frames
from smc_mujoco.draw.notebook import show as show
from smc_mujoco.envs import dm_control_env, gymnasium_env, vector_env
from smc_mujoco.envs.agent import agent as agent
from smc_mujoco.mechanisms.custom.plant_from import Channel as Channel
from smc_mujoco.mechanisms.custom.plant_from import plant_from as plant_from
from smc_mujoco.mechanisms.fidelity import deviation as deviation
from smc_mujoco.mechanisms.hardware.backlash import Backlash as Backlash
from smc_mujoco.mechanisms.hardware.contact import Contact as Contact
from smc_mujoco.mechanisms.hardware.drives import DCMotor as DCMotor
from smc_mujoco.mechanisms.hardware.drives import Lag as Lag
from smc_mujoco.mechanisms.hardware.drives import RateLimit as RateLimit
from smc_mujoco.mechanisms.hardware.encoder import Encoder as Encoder
from smc_mujoco.mechanisms.hardware.friction import Coulomb as Coulomb
from smc_mujoco.mechanisms.hardware.friction import LuGre as LuGre
from smc_mujoco.mechanisms.hardware.friction import Viscous as Viscous
from smc_mujoco.mechanisms.plant import Plant as Plant
from smc_mujoco.mechanisms.plant import plant as plant
from smc_mujoco.mechanisms.plant import plants as plants
from smc_mujoco.metrics.catalogue import score as score
from smc_mujoco.metrics.catalogue import scores as scores
from smc_mujoco.simulation.conditions import condition as condition
from smc_mujoco.simulation.grid import grid as grid
from smc_mujoco.simulation.initial_states import starts as starts
from smc_mujoco.simulation.perturbations import Jump as Jump
from smc_mujoco.simulation.perturbations import Noise as Noise
from smc_mujoco.simulation.run import PlainLoopWarning as PlainLoopWarning
from smc_mujoco.simulation.run import run as run
from smc_mujoco.simulation.run import stream as stream
from smc_mujoco.simulation.scenario import Scenario as Scenario
from smc_mujoco.simulation.signals import BandLimited as BandLimited
from smc_mujoco.simulation.signals import Constant as Constant
from smc_mujoco.simulation.signals import Gust as Gust
from smc_mujoco.simulation.signals import Impulse as Impulse
from smc_mujoco.simulation.signals import MinimumJerk as MinimumJerk
from smc_mujoco.simulation.signals import OrnsteinUhlenbeck as OrnsteinUhlenbeck
from smc_mujoco.simulation.signals import Pulse as Pulse
from smc_mujoco.simulation.signals import Ramp as Ramp
from smc_mujoco.simulation.signals import Signal as Signal
from smc_mujoco.simulation.signals import Sine as Sine
from smc_mujoco.simulation.signals import Step as Step
from smc_mujoco.simulation.time_series import TimeSeries as TimeSeries
from smc_mujoco.simulation.trace import Trace as Trace
from smc_mujoco.simulation.trace import load as load
from smc_mujoco.studies.advice import Advice as Advice
from smc_mujoco.studies.adviser import which as which
from smc_mujoco.studies.leaderboard import leaderboard as leaderboard
from smc_mujoco.studies.outcome import Outcome as Outcome
from smc_mujoco.studies.paper import scenarios
from smc_mujoco.studies.paper.claims.audit import claims as claims
from smc_mujoco.studies.paper.claims.verdict import Claim as Claim
from smc_mujoco.studies.report import report as report
from smc_mujoco.studies.scene import Scene as Scene
from smc_mujoco.studies.study import study as study
from smc_mujoco.studies.table import Table as Table
from smc_mujoco.twins.rig import Rig as Rig
from smc_mujoco.twins.rig import rig as rig
from smc_mujoco.twins.rig import rigs as rigs

__version__: str
boards = smc_mujoco.studies.boards
gym = gymnasium_env
paper = scenarios
suite = dm_control_env
vector = vector_env
