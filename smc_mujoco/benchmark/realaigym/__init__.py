"""RealAIGym's boards for pendubot and acrobot: criteria, scores, robustness test, published rows
and this package's.

    trace = smc.run(smc.boards.entry("acrobot"))   # an optimised trajectory under a Riccati law
    smc.boards.criteria(trace)                     # swing-up time, energy, ...
    smc.boards.score(trace)                        # of version 2; score(trace, "v1") of the older board
    smc.boards.robustness(smc.boards.entry("acrobot")).percent

    trace = smc.run(smc.boards.on_board("pendubot", my_law()))
    smc.boards.board(trace, "my law")              # the published rows with this one among them

    smc.boards.global_row("my law", smc.boards.on_board("pendubot", my_law()))  # the board of 2025,
    with resets

`experiments(robot)` has the entry and its control experiments: other feedbacks, and measured
velocities; `global_experiments(robot)` those of the board of 2025. A law by any design may be an
entry. docs/boards.md tells the rules and what this package's entries reach.
"""

from smc_mujoco.benchmark.realaigym.entries import FEEDBACKS as FEEDBACKS
from smc_mujoco.benchmark.realaigym.entries import entry as entry
from smc_mujoco.benchmark.realaigym.entries import on_board as on_board
from smc_mujoco.benchmark.realaigym.global_policy import global_row as global_row
from smc_mujoco.benchmark.realaigym.published import GLOBAL as GLOBAL
from smc_mujoco.benchmark.realaigym.published import ROBUSTNESS as ROBUSTNESS
from smc_mujoco.benchmark.realaigym.published import SIMULATION as SIMULATION
from smc_mujoco.benchmark.realaigym.published import SOURCE as SOURCE
from smc_mujoco.benchmark.realaigym.published import GlobalRow as GlobalRow
from smc_mujoco.benchmark.realaigym.published import RobustnessRow as RobustnessRow
from smc_mujoco.benchmark.realaigym.published import Row as Row
from smc_mujoco.benchmark.realaigym.scoring import ROBOTS as ROBOTS
from smc_mujoco.benchmark.realaigym.scoring import Criteria as Criteria
from smc_mujoco.benchmark.realaigym.scoring import criteria as criteria
from smc_mujoco.benchmark.realaigym.scoring import score as score
from smc_mujoco.benchmark.realaigym.simulator import Robustness as Robustness
from smc_mujoco.benchmark.realaigym.simulator import robustness as robustness
from smc_mujoco.benchmark.realaigym.standings import KEY as KEY
from smc_mujoco.benchmark.realaigym.standings import NAME as NAME
from smc_mujoco.benchmark.realaigym.standings import board as board
from smc_mujoco.benchmark.realaigym.standings import experiments as experiments
from smc_mujoco.benchmark.realaigym.standings import global_board as global_board
from smc_mujoco.benchmark.realaigym.standings import robustness_board as robustness_board
from smc_mujoco.benchmark.realaigym.swing_ups import GLOBAL_NAME as GLOBAL_NAME
from smc_mujoco.benchmark.realaigym.swing_ups import global_entry as global_entry
from smc_mujoco.benchmark.realaigym.swing_ups import global_experiments as global_experiments
