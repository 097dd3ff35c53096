"""Five public studies of sliding mode, run again by this package alone: two of a two-link arm, one
of a cart-pole, one of a link that hangs, one of a unit mass.

    python benchmarks/public_studies.py

It prints the studies' numbers beside this package's. docs/published.md says where they are from and
what does not agree; tests/published/test_public_studies.py holds the same runs against integrations
of the studies' equations. A minute of processor time.
"""

import math

import numpy as np

import smc_mujoco as smc

ARM = """
<mujoco model="arm"><option gravity="0 0 -9.81"/><worldbody><body>
  <joint name="shoulder" axis="0 -1 0"/>
  <inertial pos="0.2 0 0" mass="6" diaginertia="0.43 0.43 0.43"/>
  <body pos="0.5 0 0"><joint name="elbow" axis="0 -1 0"/>
    <inertial pos="0.1 0 0" mass="4" diaginertia="0.05 0.05 0.05"/>
    <body pos="0.4 0 0"><inertial pos="0 0 0" mass="0.5" diaginertia="1e-9 1e-9 1e-9"/></body>
  </body></body></worldbody></mujoco>
"""
MASSES = 6.0, 4.0  # kg, of the links
LENGTHS = 0.5, 0.4  # m
# what the law takes for places of the centres, m, inertias, kg m^2, and load, kg; and how wrong
# these may be
GUESSED = 0.25, 0.15, 0.2, 0.1, 1.0
ERRORS = 0.3, 0.25, 0.48, 0.14, 2.0
ARM_START = math.pi / 3, math.pi / 3  # rad
SLOW = 0.2 * math.pi  # rad/s
STEP = smc.Constant(math.pi / 2), smc.Constant(-math.pi / 3)
PATH = (
    smc.Constant(math.pi / 4) + smc.Sine(math.pi / 6, SLOW),
    smc.Constant(-math.pi / 3) + smc.Sine(math.pi / 3, SLOW, math.pi / 2),
)
# slope, 1/s -> settling time, s, and largest |u|, N m, to rest and along the path
PETRIDIS = {
    3.0: (3.4, 30, 7.8, 59),
    5.0: (1.2, 150, 7.1, 190),
    6.0: (1.0, 280, 1.0, 60),
    9.0: (0.5, 680, 0.6, 200),
    11.0: (0.4, 1000, 0.4, 270),
}
CART = """
<mujoco model="cart"><option gravity="0 0 -9.81"/><worldbody><body>
  <joint name="slide" type="slide" axis="1 0 0"/>
  <inertial pos="0 0 0" mass="0.5" diaginertia="1e-9 1e-9 1e-9"/>
  <body><joint name="hinge" axis="0 1 0"/>
    <inertial pos="0 0 0.2" mass="0.2" diaginertia="1e-9 1e-9 1e-9"/></body>
  </body></worldbody></mujoco>
"""
TILT = math.radians(6.0)
LIMA_MEAN = 14.782954 / (17161 * 0.002)  # N, of |u| in 39.98 s: each period counts for 2 ms
LIMA_STEPS = 82.044341  # N, sum of the steps of u
# t, s -> x, m; q, rad; u, N
LIMA = {
    0.002: (0.000007, 0.104693, 1.717564),
    0.05: (0.003218, 0.094998, 0.375200),
    0.1: (0.009739, 0.080436, 0.119105),
    0.2: (0.027862, 0.053873, -0.073364),
    0.5: (0.101058, -0.001915, -0.438110),
}
LINK = """
<mujoco model="link"><option gravity="0 0 -9.81"/><worldbody><body>
  <joint name="hinge" axis="0 1 0" damping="1"/>
  <inertial pos="0 0 -1" mass="1" diaginertia="1e-9 1e-9 1e-9"/></body></worldbody></mujoco>
"""
UNIT = """
<mujoco model="unit"><worldbody><body><joint name="slide" type="slide" axis="1 0 0"/>
  <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>
"""


@smc.law_function(joint=True, gains={"lam": 5.0, "width": 0.1, "c": 0.5})
def bounded(y, gains, memory):
    """Equivalent command of a guessed arm; a layer as high as the guess may be wrong."""
    m1, m2 = MASSES
    l1, l2 = LENGTHS
    lc1, lc2, i1, i2, load = GUESSED
    d1, d2, di1, di2, dload = ERRORS
    s = y.de + gains.lam * y.e
    keep = y.ddr - gains.lam * y.de
    fold = math.cos(y.x[1])
    upper = 9.81 * math.cos(y.x[0])
    lower = 9.81 * math.cos(y.x[0] + y.x[1])
    # Coriolis forces over their masses
    turn = l1 * math.sin(y.x[1])
    first = -turn * y.v[1] * (2.0 * y.v[0] + y.v[1])
    second = turn * y.v[0] * y.v[0]
    first_most = turn * (-y.v[1] * abs(y.v[0]) - (y.v[0] + y.v[1]) * abs(y.v[1]))
    second_most = turn * y.v[0] * abs(y.v[0])
    u = np.zeros(2)
    arm = m2 * lc2 + load * l2
    h11 = m1 * lc1**2 + m2 * (lc2**2 + l1**2 + 2 * l1 * lc2 * fold) + i1 + i2
    h11 += load * (l1**2 + l2**2 + 2 * l1 * l2 * fold)
    h12 = m2 * lc2 * (lc2 + l1 * fold) + load * l2 * (l2 + l1 * fold) + i2
    h22 = m2 * lc2**2 + load * l2**2 + i2
    most = m2 * d2 + dload * l2
    e11 = m1 * d1 + m2 * d2 * (1 + 2 * l1 * fold) + di1 + di2
    e11 += dload * (l1**2 + l2**2 + 2 * l1 * l2 * fold)
    e12 = m2 * d2 * (1 + l1 * fold) + dload * l2 * (l2 + l1 * fold) + di2
    e22 = m2 * d2 + dload * l2**2 + di2
    high1 = e11 * abs(keep[0]) + e12 * abs(keep[1]) + most * (first_most + lower) + gains.c[0]
    high1 += (dload * l1 + m1 * d1) * upper
    high2 = e12 * abs(keep[0]) + e22 * abs(keep[1]) + most * (second_most + lower) + gains.c[1]
    layer = np.minimum(np.maximum(s / gains.width, -1.0), 1.0)
    u[0] = h11 * keep[0] + h12 * keep[1] + arm * (first + lower) - high1 * layer[0]
    u[0] += (m2 * l1 + load * l1 + m1 * lc1) * upper
    u[1] = h12 * keep[0] + h22 * keep[1] + arm * (second + lower) - high2 * layer[1]
    return u, s


@smc.law_function(gains={"eta": 2.5, "width": 0.05})
def combined(y, gains, memory):
    """One surface of cart and pole, with masses that are 15 % too small."""
    cart, pole, length = 0.425, 0.17, 0.2
    a, b, la, lb = 0.02, 0.2, 0.05, 0.5
    s = a * y.de + b * y.dq + la * y.e + lb * y.q
    total, about, across = cart + pole, pole * length**2, pole * length * math.cos(y.q)
    along = pole * length * y.dq * y.dq * math.sin(y.q)
    falling = pole * length * 9.81 * math.sin(y.q)
    own = a / (total - across * across / about)
    free = b / (about - across * across / total)
    gain = own - free * across / total
    drift = own * (along - across / about * falling) + free * (falling - across / total * along)
    layer = min(max(s / gains.width, -1.0), 1.0)
    return -(drift + la * y.de + lb * y.dq + gains.eta * layer) / gain, s


@smc.hardware.friction_function(numbers={"level": 0.4})
def pushing(y, p, memory):
    """A force along the velocity, as the study's code has it."""
    if y.v == 0.0:
        return 0.0, 0.0, 0.0
    return -p.level * math.copysign(1.0, y.v), 0.0, 0.0


@smc.law_function(gains={"la": 5.0, "Kd": 10.0, "epsilon": 0.1})
def layered(y, gains, memory):
    """The torques of a hanging link of 1 kg and 1 m, and a boundary layer."""
    s = y.de + gains.la * y.e
    layer = min(max(s / gains.epsilon, -1.0), 1.0)
    return (1.0 - gains.la) * y.de + 9.81 * math.sin(y.x) - gains.Kd * layer, s


@smc.law_function(gains={"c": 1.5, "alpha": 2.0, "epsilon": 0.01})
def smoothed(y, gains, memory):
    """A smooth sign, and the equivalent control of s = 0."""
    s = y.de + gains.c * y.e
    return -gains.c * y.de - gains.alpha * s / (abs(s) + gains.epsilon), s


def arm(lam, goal=STEP, width=0.1, c=0.5, duration=10.0):
    """Return the scenario of the arm."""
    free = smc.Channel(motor=True, u_max=5e3)
    plant = smc.plant_from(ARM, channels={"shoulder": free, "elbow": free})
    return smc.Scenario(
        plant=plant,
        law=bounded(lam=lam, width=width, c=c),
        reference=list(goal),
        x0=ARM_START,
        duration=duration,
        control_period=5e-5,
        physics_step=5e-5,
    )


def cart(duration=39.98, level=0.4):
    """Return the scenario of the cart-pole; a negative level resists, as friction does."""
    slide = smc.Channel(motor=True, u_max=100.0, partner="hinge", partner_x0=TILT)
    return smc.Scenario(
        plant=smc.plant_from(CART, channels={"slide": slide}),
        law=combined,
        friction=pushing(level=(level, 0.0)),
        duration=duration,
        control_period=2e-3,
        physics_step=1.25e-4,
    )


def link():
    """Return the scenario of the hanging link."""
    return smc.Scenario(
        plant=smc.plant_from(LINK, channels={"hinge": smc.Channel(motor=True, u_max=20.0)}),
        law=layered,
        reference=smc.Constant(math.pi / 4),
        x0=0.0,
        duration=5.0,
        control_period=0.01,
    )


def unit():
    """Return the scenario of the unit mass."""
    return smc.Scenario(
        plant=smc.plant_from(UNIT, channels={"slide": smc.Channel(motor=True, u_max=100.0)}),
        law=smoothed,
        disturbance=smc.Sine(1.0, 2.0),
        x0=1.0,
        v0=-2.0,
        duration=10.0,
        control_period=1e-4,
    )


def settled(trace, within=0.05):
    """Return when all errors stay within a bound, s."""
    late = np.abs(trace.x - trace.r).max(axis=1) > within
    return float(trace.t[late].max(initial=0.0))


def main() -> None:
    """Print the studies' numbers beside those of the runs."""
    print("Petridis: slope | settles, s | largest |u|, N m | the same along the path")
    for lam, printed in PETRIDIS.items():
        row = []
        for trace in smc.run([arm(lam), arm(lam, PATH)]):
            row += [f"{settled(trace):.2f}", f"{np.abs(trace.u).max():.0f}"]
        print(lam, *(f"| {study} {here}" for study, here in zip(printed, row, strict=True)))
    trace = smc.run(cart())
    u = trace.u[:, 0]
    print("Lima and Bessa: t, s | x, m | q, rad | u, N, theirs and here")
    for t, row in LIMA.items():
        k = round(t / 2e-3)
        print(t, row, *trace.x[k].round(6), u[k - 1].round(6))
    print(f"mean |u| {LIMA_MEAN:.4f} {np.abs(u[:-1]).mean():.4f} N")
    print(f"sum of its steps {LIMA_STEPS:.3f} {np.abs(np.diff(u[:-1], prepend=0.0)).sum():.3f} N")


if __name__ == "__main__":
    main()
