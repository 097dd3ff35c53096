"""Sub-optimal: u = -r1 sgn(e - m/2) + r2 sgn(m), m = e where de last was 0.

A 2-sliding law that needs only the zeros of de, not its value. A zero lies between two samples
whose de differ in sign. Conditions for e'' = g u + d, |d| <= D: r1 > r2, 2 ((r1 + r2) g - D) > (r1
- r2) g + D and (r1 - r2) g > D. The law brakes half-way: from rest and without d, the next extremum
of e is r2 / (r1 + r2) of the last one, without overshoot. Before the first zero of de, m is 0 and u
= -r1 sgn(e). Sampled, |e| = O(dt^2). The trace's s is e, of relative degree 2.
Gains: r1 and r2, of the two switching terms [N].
Source: G. Bartolini, A. Ferrara & E. Usai, "Chattering avoidance by second-order sliding mode
control", IEEE Trans. Autom. Control 43(2):241, 1998; form and conditions of A. Levant, "Principles
of 2-sliding mode design", Automatica 43(4):576, 2007.
"""

from smc_mujoco.control.law import command, law_function, sgn
from smc_mujoco.control.units import FORCE, Gain


@law_function(
    family="higher-order",
    finite_time="e",
    accuracy=2,
    gains={
        "r1": Gain(4.0, FORCE, positive=True),
        "r2": Gain(1.5, FORCE, positive=True),
    },
    memory=3,
    relative_degree=2,
    conditions={"r1 > r2": lambda g: g.r1 > g.r2},
)
def suboptimal(y, gains, memory):
    if y.de * memory[1] < 0.0 or y.de == 0.0:  # memory: m, last de, last e
        memory[0] = y.e if abs(y.e) > abs(memory[2]) else memory[2]
        if y.de == 0.0:
            memory[0] = y.e
    memory[1] = y.de
    memory[2] = y.e
    return command(y, -gains.r1 * sgn(y.e - 0.5 * memory[0]) + gains.r2 * sgn(memory[0])), y.e
