"""RealAIGym's boards for pendubot and acrobot: criteria, scores, robustness test, published rows
and this package's.

    import realaigym  # from a script in benchmarks/, or with that folder on PYTHONPATH

    trace = smc.run(realaigym.entry("acrobot"))   # an optimised trajectory under a Riccati law
    realaigym.criteria(trace)                     # swing-up time, energy, ...
    realaigym.score(trace)                        # of version 2; "v1" is the older board
    realaigym.robustness(realaigym.entry("acrobot")).percent

    trace = smc.run(realaigym.on_board("pendubot", my_law()))
    realaigym.board(trace, "my law")              # the published rows with this one among them

    realaigym.global_row("my law", realaigym.on_board("pendubot", my_law()))  # the board of 2025,
    with resets

`experiments(robot)` has the entry and its control experiments: other feedbacks, and measured
velocities; `global_experiments(robot)` those of the board of 2025. A law by any design may be an
entry. docs/boards.md tells the rules and what this package's entries reach.
"""

from realaigym.entries import FEEDBACKS as FEEDBACKS
from realaigym.entries import entry as entry
from realaigym.entries import on_board as on_board
from realaigym.global_policy import global_row as global_row
from realaigym.published import GLOBAL as GLOBAL
from realaigym.published import ROBUSTNESS as ROBUSTNESS
from realaigym.published import SIMULATION as SIMULATION
from realaigym.published import SOURCE as SOURCE
from realaigym.published import GlobalRow as GlobalRow
from realaigym.published import RobustnessRow as RobustnessRow
from realaigym.published import Row as Row
from realaigym.scoring import ROBOTS as ROBOTS
from realaigym.scoring import Criteria as Criteria
from realaigym.scoring import criteria as criteria
from realaigym.scoring import score as score
from realaigym.simulator import Robustness as Robustness
from realaigym.simulator import robustness as robustness
from realaigym.standings import KEY as KEY
from realaigym.standings import NAME as NAME
from realaigym.standings import board as board
from realaigym.standings import experiments as experiments
from realaigym.standings import global_board as global_board
from realaigym.standings import robustness_board as robustness_board
from realaigym.swing_ups import GLOBAL_NAME as GLOBAL_NAME
from realaigym.swing_ups import global_entry as global_entry
from realaigym.swing_ups import global_experiments as global_experiments
