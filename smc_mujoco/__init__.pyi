import smc_mujoco.evidence.boards
import smc_mujoco.evidence.papers.gaber.scenarios
import smc_mujoco.studies.arms
from smc_mujoco import design as design
from smc_mujoco import envs as envs
from smc_mujoco import errors as errors
from smc_mujoco import exchange as exchange
from smc_mujoco import fidelity as fidelity
from smc_mujoco import hardware as hardware
from smc_mujoco import metrics as metrics
from smc_mujoco import signals as signals
from smc_mujoco.analysis.chattering import chattering as chattering
from smc_mujoco.analysis.margins import margins as margins
from smc_mujoco.analysis.region_of_attraction import basin as basin
from smc_mujoco.analysis.tuning.search import tune as tune
from smc_mujoco.analysis.worst_case.uncertainty import Uncertainty as Uncertainty
from smc_mujoco.cli.main import play as play
from smc_mujoco.common.errors import ScenarioError as ScenarioError
from smc_mujoco.control.estimator import estimator as estimator
from smc_mujoco.control.estimator import estimator_function as estimator_function
from smc_mujoco.control.from_text import law as law
from smc_mujoco.control.law import Law as Law
from smc_mujoco.control.law import Measurement as Measurement
from smc_mujoco.control.law import law_function as law_function
from smc_mujoco.control.law import laws as laws
from smc_mujoco.control.surface import surface as surface
from smc_mujoco.control.surface import surface_function as surface_function
from smc_mujoco.draw.dot_plot import plot as plot
from smc_mujoco.draw.figure import figure as figure
from smc_mujoco.draw.film.film import film as film
from smc_mujoco.draw.notebook import show as show
from smc_mujoco.evidence.accuracy.accuracy import accuracy as accuracy
from smc_mujoco.evidence.audit.audit import audit as audit
from smc_mujoco.evidence.audit.audit import claims as claims
from smc_mujoco.evidence.certificates.maker import certify as certify
from smc_mujoco.evidence.report import report as report
from smc_mujoco.evidence.rigs.identify import identify as identify
from smc_mujoco.evidence.rigs.rig import rig as rig
from smc_mujoco.evidence.rigs.rig import rigs as rigs
from smc_mujoco.exchange.law_from import law_from as law_from
from smc_mujoco.exchange.live.build import live as live
from smc_mujoco.exchange.policy import policy as policy
from smc_mujoco.mechanisms.custom.plant_from import Channel as Channel
from smc_mujoco.mechanisms.custom.plant_from import plant_from as plant_from
from smc_mujoco.mechanisms.hardware.backlash import Backlash as Backlash
from smc_mujoco.mechanisms.hardware.contact import Contact as Contact
from smc_mujoco.mechanisms.hardware.drives import DCMotor as DCMotor
from smc_mujoco.mechanisms.hardware.drives import Lag as Lag
from smc_mujoco.mechanisms.hardware.encoder import Encoder as Encoder
from smc_mujoco.mechanisms.hardware.friction import Coulomb as Coulomb
from smc_mujoco.mechanisms.hardware.friction import Viscous as Viscous
from smc_mujoco.mechanisms.plant import Plant as Plant
from smc_mujoco.mechanisms.plant import plant as plant
from smc_mujoco.mechanisms.plant import plants as plants
from smc_mujoco.metrics.catalogue import score as score
from smc_mujoco.metrics.catalogue import scores as scores
from smc_mujoco.simulation.conditions import condition as condition
from smc_mujoco.simulation.grid import grid as grid
from smc_mujoco.simulation.grid import starts as starts
from smc_mujoco.simulation.run import run as run
from smc_mujoco.simulation.run import stream as stream
from smc_mujoco.simulation.scenario import Scenario as Scenario
from smc_mujoco.simulation.signals import Clock as Clock
from smc_mujoco.simulation.signals import Constant as Constant
from smc_mujoco.simulation.signals import Jump as Jump
from smc_mujoco.simulation.signals import Noise as Noise
from smc_mujoco.simulation.signals import Push as Push
from smc_mujoco.simulation.signals import Signal as Signal
from smc_mujoco.simulation.signals import Sine as Sine
from smc_mujoco.simulation.signals import Step as Step
from smc_mujoco.simulation.trace import Trace as Trace
from smc_mujoco.simulation.trace import load as load
from smc_mujoco.studies.adviser import which as which
from smc_mujoco.studies.compare import compare as compare
from smc_mujoco.studies.leaderboard import leaderboard as leaderboard
from smc_mujoco.studies.scene import Scene as Scene
from smc_mujoco.studies.study import study as study
from smc_mujoco.studies.table import Table as Table
from smc_mujoco.studies.worst_case import worst_case as worst_case

__version__: str
arms = smc_mujoco.studies.arms
boards = smc_mujoco.evidence.boards
paper = smc_mujoco.evidence.papers.gaber.scenarios
