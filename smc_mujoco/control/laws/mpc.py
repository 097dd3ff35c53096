"""Model-predictive control without offset: u = v + us, the first move of the best plan of N moves
of H each.

    minimise  sum of (q1 e^2 + q2 de^2 + r v^2) over the moves, + x' P x at the end,
    with  |v + us| <= u_max

on e'' = a1 e + a2 de + b u + d, sampled exactly over H. d is the estimate of the observer of
`adrc`, which knows a1 e + a2 de, and us = -d / b, so a constant disturbance leaves no error. P is
the solution of the discrete Riccati equation, so that without bounds the law is the linear
quadratic regulator, and cancels d. It differs from that regulator, clipped, only where a later move
is at the bound: real gains need bounds on states or rates, or a reference known ahead. As long as
the same moves are held at a bound, the plan is an affine function of e, de and the bounds. The law
keeps this function, and is as fast as a regulator. Where the function may end it is checked move by
move. Where it has ended, projected Newton steps find a new plan, from the last one, clipped, or
from v = 0 where that fails, until the gradient of the free moves is 1e-13 of the linear term. Every
plan keeps the bounds. Of 24,000 jumps to a random state 10 were not solved, one of them with a cost
64 % too large, the others 4 % at most. H must be long against the control period, and N H as long
as the loop takes to come to rest. With the nominal model f and g are cancelled and the law
regulates e'' = v, so a1, a2, b are 0, 0, 1. The trace's s is the slope of the cost at v = 0 in the
first move.
Gains: q1 [N^2/m^2], q2 [N^2 s^2/m^2] and r, weights of error, rate and control; w, bandwidth of the
observer [1/s]; N, number of moves, at most 20; H, time of a move [s]; a1 [1/s^2], a2 [1/s] and b
[1/kg], by default those of the plant at its origin.
Sources: D. P. Bertsekas, "Projected Newton methods for optimization problems with simple
constraints", SIAM J. Control Optim. 20(2):221, 1982 (the steps); E. K.-W. Chu, H.-Y. Fan, W.-W. Lin
& C.-S. Wang, "Structure-preserving algorithms for periodic discrete-time algebraic Riccati
equations", Int. J. Control 77(8):767, 2004 (doubling, for P); U. Maeder, F. Borrelli & M. Morari,
"Linear offset-free model predictive control", Automatica 45(10):2214, 2009; J. A. De Dona, G. C.
Goodwin & M. M. Seron, "Anti-windup and model predictive control: reflections and connections", Eur.
J. Control 6(5):467, 2000 (where it is the clipped regulator).
"""

import math

from numba import njit

from smc_mujoco.control.law import command, law_function, linear_plant
from smc_mujoco.control.laws.extended_state import corrections, observe
from smc_mujoco.control.units import LINEAR_PLANT, RATE, TIME, WEIGHTS, Gain

# The memory: 0 to 4 the observer; 5, 1 once the matrices are there; 6, the held moves of the
# Cholesky factor, as bits;
# 7 to 9, the observer's corrections; 10 to 17, where the tabulated plan was last checked, see
# `room`; then a row for each move: itself, its side (-1 held at the lower bound, 1 at the upper, 0
# free), its function of e, de and the bounds' middle and reach, the linear term by e and by de; the
# gradient, the step, what a share of it changes; and the Hessian and the factor, 20 x 20, by rows.
# chosen; from no plan 34 steps were enough in 60,000 states
MOVES = 20
MOST_STEPS = 40
MOST_HALVINGS = 40
TERMS = 40
AT_E, AT_DE, AT_MIDDLE, AT_REACH, MOST_E, MOST_DE, MOST_MIDDLE, ROOM = range(10, 18)
PLAN, SIDE, FROM_E, FROM_DE, FROM_MIDDLE, FROM_REACH, BY_E, BY_DE = range(18, 26)
ROW = 8
GRADIENT = 178
STEP = 198
MOVED = 218
HESSIAN = 238
FACTOR = 638
SLOTS = 1038
UNBOUNDED = 1e30  # in place of no bound, as 0 times infinity is no number
# gradient of free moves over the linear term: solved up to it; above it, solved from v = 0
ENOUGH, FAR = (1e-13, 1e-6)
SUFFICIENT = 1e-4  # share of the decrease that the gradient promises, L. Armijo's


@njit
def sampled(a1, a2, b, H):
    """Return the matrix A, by rows, and the vector B of e'' = a1 e + a2 de + b v over the time H, v
    constant.
    """
    # the series of the exponential: T_k = (M H)^k / k!, A = sum of T_k, and the integral is H sum
    # of T_k / (k + 1)
    t11 = 1.0
    t12 = 0.0
    t21 = 0.0
    t22 = 1.0
    A11 = 1.0
    A12 = 0.0
    A21 = 0.0
    A22 = 1.0
    B1 = 0.0
    B2 = b * H
    for k in range(1, TERMS):
        n11 = t21 * H / k
        n12 = t22 * H / k
        t21 = (a1 * t11 + a2 * t21) * H / k
        t22 = (a1 * t12 + a2 * t22) * H / k
        t11 = n11
        t12 = n12
        A11 = A11 + t11
        A12 = A12 + t12
        A21 = A21 + t21
        A22 = A22 + t22
        B1 = B1 + b * H * t12 / (k + 1)
        B2 = B2 + b * H * t22 / (k + 1)
    return A11, A12, A21, A22, B1, B2


@njit
def riccati(A11, A12, A21, A22, B1, B2, q1, q2):
    """Return P11, P12, P22 of the discrete Riccati equation with the weights q1, q2 and 1, by
    doubling.
    """
    g11 = B1 * B1
    g12 = B1 * B2
    g22 = B2 * B2
    p11 = q1
    p12 = 0.0
    p22 = q2
    a11 = A11
    a12 = A12
    a21 = A21
    a22 = A22
    for _ in range(TERMS):
        # W = (1 + G P)^-1
        m11 = 1.0 + g11 * p11 + g12 * p12
        m12 = g11 * p12 + g12 * p22
        m21 = g12 * p11 + g22 * p12
        m22 = 1.0 + g12 * p12 + g22 * p22
        det = m11 * m22 - m12 * m21
        w11 = m22 / det
        w12 = -m12 / det
        w21 = -m21 / det
        w22 = m11 / det
        # P grows by a' P W a, G by a W G a', and a becomes a W a
        c11 = w11 * a11 + w12 * a21
        c12 = w11 * a12 + w12 * a22
        c21 = w21 * a11 + w22 * a21
        c22 = w21 * a12 + w22 * a22
        r11 = p11 * c11 + p12 * c21
        r12 = p11 * c12 + p12 * c22
        r21 = p12 * c11 + p22 * c21
        r22 = p12 * c12 + p22 * c22
        h11 = w11 * g11 + w12 * g12
        h12 = w11 * g12 + w12 * g22
        h21 = w21 * g11 + w22 * g12
        h22 = w21 * g12 + w22 * g22
        s11 = a11 * h11 + a12 * h21
        s12 = a11 * h12 + a12 * h22
        s21 = a21 * h11 + a22 * h21
        s22 = a21 * h12 + a22 * h22
        more11 = a11 * r11 + a21 * r21
        more12 = a11 * r12 + a21 * r22
        more22 = a12 * r12 + a22 * r22
        p11 = p11 + more11
        p12 = p12 + more12
        p22 = p22 + more22
        g11 = g11 + s11 * a11 + s12 * a12
        g12 = g12 + s11 * a21 + s12 * a22
        g22 = g22 + s21 * a21 + s22 * a22
        a11, a12, a21, a22 = (
            a11 * c11 + a12 * c21,
            a11 * c12 + a12 * c22,
            a21 * c11 + a22 * c21,
            a21 * c12 + a22 * c22,
        )
        if abs(more11) + abs(more22) <= 1e-16 * (p11 + p22):
            break
    return p11, p12, p22


@njit
def prepare(n, a1, a2, b, H, q1, q2, memory):
    """Write the Hessian and the linear terms of the plan's cost, halved, into the memory.

    Return 1.
    """
    A11, A12, A21, A22, B1, B2 = sampled(a1, a2, b, H)
    s11, s12, s22 = riccati(A11, A12, A21, A22, B1, B2, q1, q2)
    for k in range(n):
        i = n - 1 - k
        # B' S of the cost from move i + 1 on without control; then back through A, one move earlier
        # each
        v1 = B1 * s11 + B2 * s12
        v2 = B1 * s12 + B2 * s22
        memory[HESSIAN + MOVES * i + i] = 1.0 + v1 * B1 + v2 * B2
        for m in range(i):
            j = i - 1 - m
            v1, v2 = v1 * A11 + v2 * A21, v1 * A12 + v2 * A22
            memory[HESSIAN + MOVES * i + j] = v1 * B1 + v2 * B2
            memory[HESSIAN + MOVES * j + i] = v1 * B1 + v2 * B2
        memory[BY_E + ROW * i] = v1 * A11 + v2 * A21
        memory[BY_DE + ROW * i] = v1 * A12 + v2 * A22
        r11 = s11 * A11 + s12 * A21
        r12 = s11 * A12 + s12 * A22
        r21 = s12 * A11 + s22 * A21
        r22 = s12 * A12 + s22 * A22
        s11 = q1 + A11 * r11 + A21 * r21
        s12 = A11 * r12 + A21 * r22
        s22 = q2 + A12 * r12 + A22 * r22
    memory[ROOM] = -1.0
    return tabulate(n, -math.inf, math.inf, memory)


@njit
def residual(n, e, de, low, high, memory):
    """Write the gradient of the plan into the memory. Return the largest of the free moves, over
    the linear term.
    """
    for i in range(n):
        memory[GRADIENT + i] = memory[BY_E + ROW * i] * e + memory[BY_DE + ROW * i] * de
    size = 0.0
    for i in range(n):
        size = max(size, abs(memory[GRADIENT + i]))
    for j in range(n):  # by columns, which are rows
        v = memory[PLAN + ROW * j]
        for i in range(n):
            memory[GRADIENT + i] += memory[HESSIAN + MOVES * j + i] * v
    largest = 0.0
    for i in range(n):
        if not held(i, low, high, memory):
            largest = max(largest, abs(memory[GRADIENT + i]))
    return largest / size if size > 0.0 else largest


@njit
def held(i, low, high, memory):
    """Return whether a move is at a bound, and its gradient keeps it there."""
    v = memory[PLAN + ROW * i]
    slope = memory[GRADIENT + i]
    return (v <= low and slope > 0.0) or (v >= high and slope < 0.0)


@njit
def factor(n, low, high, memory):
    """Write the Cholesky factor of the Hessian of the free moves into the memory; held moves have
    the identity's rows.

    Return the held moves, as bits, and a bit above them.
    """
    bits = 1.0
    for i in range(n):
        bits *= 2.0
        if held(i, low, high, memory):
            bits += 1.0
    if bits == memory[6]:
        return bits
    for i in range(n):
        free_i = not held(i, low, high, memory)
        for j in range(i + 1):
            free = free_i and not held(j, low, high, memory)
            total = memory[HESSIAN + MOVES * i + j] if free else (1.0 if i == j else 0.0)
            for k in range(j):
                total -= memory[FACTOR + MOVES * i + k] * memory[FACTOR + MOVES * j + k]
            memory[FACTOR + MOVES * i + j] = (
                math.sqrt(total) if i == j else total / memory[FACTOR + MOVES * j + j]
            )
    return bits


@njit
def substitute(n, memory):
    """Solve for the step with the Cholesky factor, in place. Return 1."""
    for i in range(n):
        for j in range(i):
            memory[STEP + i] -= memory[FACTOR + MOVES * i + j] * memory[STEP + j]
        memory[STEP + i] /= memory[FACTOR + MOVES * i + i]
    for m in range(n):
        j = n - 1 - m
        memory[STEP + j] /= memory[FACTOR + MOVES * j + j]
        for i in range(j):
            memory[STEP + i] -= memory[FACTOR + MOVES * j + i] * memory[STEP + j]
    return 1.0


@njit
def newton(n, low, high, memory):
    """Write Newton's step of the free moves into the memory; those that are held stay. Return the
    whole share, 1.
    """
    memory[6] = factor(n, low, high, memory)
    for i in range(n):
        memory[STEP + i] = 0.0 if held(i, low, high, memory) else -memory[GRADIENT + i]
    return substitute(n, memory)


@njit
def move(n, share, low, high, memory):
    """Write how a share of the step changes the moves, each clipped to its bounds. Return whether
    none is clipped.
    """
    unclipped = True
    for i in range(n):
        v = memory[PLAN + ROW * i]
        unbounded = memory[PLAN + ROW * i] + share * memory[STEP + i]
        memory[MOVED + i] = min(max(unbounded, low), high) - v
        if unbounded < low or unbounded > high:
            unclipped = False
    return unclipped


@njit
def advance(n, low, high, memory):
    """Move the plan by a share of Newton's step that lowers the cost enough, 1 or less. Return it;
    0 for none.
    """
    share = newton(n, low, high, memory)
    for _ in range(MOST_HALVINGS):
        # a whole step that no bound clips ends at the least cost
        enough = move(n, share, low, high, memory)
        if not enough:
            promised = 0.0
            curved = 0.0
            for i in range(n):
                promised += memory[GRADIENT + i] * memory[MOVED + i]
                for j in range(n):
                    curved += (
                        memory[MOVED + i] * memory[HESSIAN + MOVES * i + j] * memory[MOVED + j]
                    )
            enough = promised + curved / 2.0 <= SUFFICIENT * promised
        if enough:
            for i in range(n):
                memory[PLAN + ROW * i] += memory[MOVED + i]
            return share
        share /= 2.0
    return 0.0


@njit
def solve(n, e, de, low, high, factor, memory):
    """Solve for the plan from a multiple of the last one, and return its `residual`."""
    for i in range(n):
        memory[PLAN + ROW * i] = min(max(factor * memory[PLAN + ROW * i], low), high)
    error = residual(n, e, de, low, high, memory)
    for _ in range(MOST_STEPS):
        if error <= ENOUGH:
            break
        if advance(n, low, high, memory) == 0.0:
            break
        error = residual(n, e, de, low, high, memory)
    return error


@njit
def tabulate(n, low, high, memory):
    """Write the plan as a function of e, de and the bounds' middle and reach, as long as the same
    moves are held.

    For a held move, write the gradient over the move's curvature instead. Return 1.
    """
    memory[6] = factor(n, low, high, memory)
    for i in range(n):
        memory[SIDE + ROW * i] = (
            -math.copysign(1.0, memory[GRADIENT + i]) if held(i, low, high, memory) else 0.0
        )
    for i in range(n):  # first the gradient where the free moves are 0
        memory[FROM_E + ROW * i], memory[FROM_DE + ROW * i] = (
            memory[BY_E + ROW * i],
            memory[BY_DE + ROW * i],
        )
        memory[FROM_MIDDLE + ROW * i] = 0.0
        memory[FROM_REACH + ROW * i] = 0.0
        for j in range(n):
            memory[FROM_MIDDLE + ROW * i] += (
                abs(memory[SIDE + ROW * j]) * memory[HESSIAN + MOVES * i + j]
            )
            memory[FROM_REACH + ROW * i] += memory[SIDE + ROW * j] * memory[HESSIAN + MOVES * i + j]
    for k in range(4):
        column = FROM_E + k
        for i in range(n):
            memory[STEP + i] = 0.0 if memory[SIDE + ROW * i] != 0.0 else -memory[column + ROW * i]
        substitute(n, memory)
        for i in range(n):
            if memory[SIDE + ROW * i] == 0.0:
                memory[column + ROW * i] = memory[STEP + i]
            else:
                for j in range(n):
                    memory[column + ROW * i] += memory[HESSIAN + MOVES * i + j] * memory[STEP + j]
                memory[column + ROW * i] /= memory[HESSIAN + MOVES * i + i]
    memory[MOST_E] = 0.0
    memory[MOST_DE] = 0.0
    memory[MOST_MIDDLE] = 0.0
    for i in range(n):
        memory[MOST_E] = max(memory[MOST_E], abs(memory[FROM_E + ROW * i]))
        memory[MOST_DE] = max(memory[MOST_DE], abs(memory[FROM_DE + ROW * i]))
        moves = 1.0 - abs(memory[SIDE + ROW * i])  # the bounds of a free move shift with the middle
        memory[MOST_MIDDLE] = max(memory[MOST_MIDDLE], abs(memory[FROM_MIDDLE + ROW * i] - moves))
    return 1.0


@njit
def tabulated(i, e, de, middle, reach, memory):
    """Return the tabulated function of move i."""
    value = memory[FROM_E + ROW * i] * e + memory[FROM_DE + ROW * i] * de
    return value + memory[FROM_MIDDLE + ROW * i] * middle + memory[FROM_REACH + ROW * i] * reach


@njit
def recall(n, e, de, middle, reach, memory):
    """Write the tabulated plan, clipped, and where that was. Return how far all moves are from the
    function's end.

    At the end a free move is at a bound, or the gradient of a held one is 0; below 0, a move is
    beyond.
    """
    margin = UNBOUNDED
    for i in range(n):
        value = tabulated(i, e, de, middle, reach, memory)
        side = memory[SIDE + ROW * i]
        if side == 0.0:
            memory[PLAN + ROW * i] = min(max(value, middle - reach), middle + reach)
            margin = min(margin, reach - abs(value - middle))
        else:
            memory[PLAN + ROW * i] = middle + side * reach
            margin = min(margin, -side * value)
    memory[AT_E] = e
    memory[AT_DE] = de
    memory[AT_MIDDLE] = middle
    memory[AT_REACH] = reach
    return margin


@njit
def room(e, de, middle, reach, memory):
    """Return the least distance of the tabulated plan from its end, by how far the state is from
    the last `recall`.
    """
    if reach != memory[AT_REACH]:
        return -1.0
    spent = memory[MOST_E] * abs(e - memory[AT_E]) + memory[MOST_DE] * abs(de - memory[AT_DE])
    return memory[ROOM] - spent - memory[MOST_MIDDLE] * abs(middle - memory[AT_MIDDLE])


@njit
def planned(n, e, de, middle, reach, memory):
    """Write the best plan: the tabulated one, or else a new one, which is then tabulated. Return
    its `recall`.
    """
    margin = recall(n, e, de, middle, reach, memory)
    if margin < 0.0:
        low = middle - reach
        high = middle + reach
        if (
            solve(n, e, de, low, high, 1.0, memory) > FAR
        ):  # bounds cut the steps short: the state is far from the last
            solve(n, e, de, low, high, 0.0, memory)
        tabulate(n, low, high, memory)
    return margin


@law_function(
    family="predictive",
    continuous=True,
    accuracy=0,
    label="MPC",
    short="MP",
    gains={
        **WEIGHTS,
        "r": Gain(1.0, positive=True, held=True),  # only the ratios of the weights matter
        "w": Gain(20.0, RATE, positive=True),
        "N": Gain(20.0, positive=True, held=True),
        "H": Gain(0.03, TIME, positive=True, held=True),
        **LINEAR_PLANT,
    },
    memory=SLOTS,
    relative_degree=2,
    conditions={"1 <= N <= 20": lambda g: 1.0 <= g.N <= MOVES},
)
def mpc(y, gains, memory):
    n = min(max(int(gains.N), 1), MOVES)
    a1, a2, b = linear_plant(y, gains.a1, gains.a2, gains.b)
    # with the model the law's own input is the acceleration g u + f - r''
    g, f = (y.g, y.f - y.ddr) if y.model != 0.0 else (1.0, 0.0)
    if memory[5] == 0.0:
        memory[5] = prepare(n, a1, a2, b, gains.H, gains.q1 / gains.r, gains.q2 / gains.r, memory)
        memory[7], memory[8], memory[9] = corrections(gains.w, y.dt)
    us = -observe(y, memory[7], memory[8], memory[9], memory) / b
    reach = min(abs(g) * y.limit, UNBOUNDED)
    middle = f - us
    if room(y.e, y.de, middle, reach, memory) < 0.0:
        memory[ROOM] = planned(n, y.e, y.de, middle, reach, memory)
        v = us + memory[PLAN]
    elif memory[SIDE] == 0.0:
        v = us + tabulated(0, y.e, y.de, middle, reach, memory)
    else:
        v = us + middle + memory[SIDE] * reach
    memory[4] = a1 * y.e + a2 * y.de + b * v
    return command(y, v), memory[BY_E] * y.e + memory[BY_DE] * y.de
