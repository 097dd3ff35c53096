"""RealAIGym's boards for pendubot and acrobot: criteria, scores, robustness test, published rows and this package's.

    trace = smc.run(smc.boards.entry("acrobot"))   # an optimised trajectory under a Riccati law
    smc.boards.criteria(trace)                     # swing-up time, energy, ...
    smc.boards.score(trace)                        # of version 2; score(trace, "v1") of the older board
    smc.boards.robustness(smc.boards.entry("acrobot")).percent

    trace = smc.run(smc.boards.on_board("pendubot", my_law()))
    smc.boards.board(trace, "my law")              # the published rows with this one among them

`experiments(robot)` has the entry and its control experiments: other feedbacks, and measured velocities. A law by any
design may be an entry. docs/boards.md tells the rules and what this package's entries reach.
"""

from smc_mujoco.evidence.boards.entries import FEEDBACKS as FEEDBACKS
from smc_mujoco.evidence.boards.entries import entry as entry
from smc_mujoco.evidence.boards.entries import on_board as on_board
from smc_mujoco.evidence.boards.published import ROBUSTNESS as ROBUSTNESS
from smc_mujoco.evidence.boards.published import SIMULATION as SIMULATION
from smc_mujoco.evidence.boards.published import SOURCE as SOURCE
from smc_mujoco.evidence.boards.published import RobustnessRow as RobustnessRow
from smc_mujoco.evidence.boards.published import Row as Row
from smc_mujoco.evidence.boards.scoring import ROBOTS as ROBOTS
from smc_mujoco.evidence.boards.scoring import Criteria as Criteria
from smc_mujoco.evidence.boards.scoring import criteria as criteria
from smc_mujoco.evidence.boards.scoring import score as score
from smc_mujoco.evidence.boards.simulator import Robustness as Robustness
from smc_mujoco.evidence.boards.simulator import robustness as robustness
from smc_mujoco.evidence.boards.standings import KEY as KEY
from smc_mujoco.evidence.boards.standings import NAME as NAME
from smc_mujoco.evidence.boards.standings import board as board
from smc_mujoco.evidence.boards.standings import experiments as experiments
from smc_mujoco.evidence.boards.standings import robustness_board as robustness_board
