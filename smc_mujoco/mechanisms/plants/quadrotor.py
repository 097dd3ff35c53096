"""Quadrotor: a free body with four rotors, by default a Crazyflie 2.x.

    m v' = u + d - m grav e3 - R D R' (v - air),    u = R e3 (f_1 + f_2 + f_3 + f_4)
    J w' = M - w x (J w + h e3) - h' e3,    h = Jr (W_1 - W_2 + W_3 - W_4)
    f_i = (F +- Mx/a +- My/a +- Mz/c)/4,    f_i = k1 W_i + k2 W_i^2,    W_i' = rise (c_i - W_i)

The channels are the position, m, in the axes of the world, and the rotation vector of the attitude
R, rad; w is in the axes of the body, x forward, y left, z up; air is the wind. Rotors from above: 1
front right, 2 rear right, 3 rear left, 4 front left; 1 and 3 turn counter-clockwise, and their drag
turns the body clockwise. A law commands a force, N, of which the rotors give the part F along R e3,
and the torque M, N m. Their shares have the signs -, -, +, + of Mx, -, +, +, - of My, and -, +, -,
+ of Mz. The excess of the largest over fmax is taken from all, then each is cut at 0, as in the
Crazyflie's firmware. c_i is the speed for a share; a rotor slows down by fall (c_i - W_i) + fall2
(c_i^2 - W_i^2).

m [kg]; Jx, Jy, Jz [kg m^2]; a, the rotors' distance from the axes of roll and pitch [m]; c, torque
per thrust [m]; fmax [N]; k1 [N s/rad], k2 [N s^2/rad^2]; rise, fall [1/s], fall2 [1/rad]; Jr [kg
m^2]; Dx, Dy, Dz, the diagonal of D [N s/m]; grav [m/s^2]. 0 by default: sag [1/N], the share of the
rotors' speed that a weak battery loses per thrust of all; fade, the share of its thrust that rotor
1 has lost; payload [kg], the mass of a steel ball, lp [m] below the body's centre. lift is the
share of the weight that the rotors carry when a run begins: 1, or 0 for a body thrown with its
rotors at rest. Laws know the masses and inertias of the plant, and where its rotors are; drag, lag,
h, sag and fade are in no law, and a payload is not if a mismatch adds it.

Published sets, `smc.plant("quadrotor", set="gym")`; those of the Crazyflie differ by 7.6 in c and
by 2.6 in D:
  crazyflie, the default: crazyflow with a lag of 0.0625 s, which the firmware's INDI takes the
    rotors to have.
  crazyflow: cf2x_L250 of crazyflow and drone-models, identified in flight; lag of a speed-up
    0.136 s, of a small slow-down at hover 0.108 s. Behind it the gains of `geometric`, the
    firmware's, leave a limit cycle that loses metres of height: so its lag is not the default. c is
    that at hover. Its Jr is marked there as doubtful.
  gym: cf2x of gym-pybullet-drones; no lag. Drag at the rotors' speed at hover, as in the next two.
  rotorpy: the Crazyflie of RotorPy, whose c is of unknown origin; lag 0.072 s.
  crazys: the Crazyflie of CrazyS; lag 0.0125 s up, 0.025 s down.
  hummingbird: the 0.5 kg vehicle of RotorPy, for scale, with its arms of 0.17 m taken as diagonal;
    lag 0.005 s.
A battery of the Crazyflie has sag 0.32: U = 4.046 V - 0.175 I, 2.39 A at 0.322 N (Bitcraze's thrust
stand, 2015). Sources: crazyflow and drone-models 0.1.0, gym-pybullet-drones, RotorPy (MIT licence),
CrazyS (Apache-2.0). The sign of the gyroscopic torque follows from the balance of angular momentum;
drone-models 0.1.0 has it wrong in roll.
"""

import math

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.custom.nominal_model import NominalModel
from smc_mujoco.mechanisms.hardware.rotors import ROTOR
from smc_mujoco.mechanisms.plant import Field, Plant, Values, geom_fields, model_spec

NAMES = ("rotor1", "rotor2", "rotor3", "rotor4")
PLACES = ((1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0))  # of the rotors along x and y, in a
SPINS = (1.0, -1.0, 1.0, -1.0)
STEEL_DENSITY = 7850.0  # kg/m^3
HOVER = 1.0  # m, height of the default reference
AT_ONCE = 1e6  # 1/s, rate of a rotor without lag
LEVER = 0.03253  # m, that the shapes are drawn for
MIN_RADIUS = 1e-6  # m, of a payload of no mass

IDENTIFIED: dict[str, float] = {
    "m": 0.0319,
    "Jx": 16.8e-6,
    "Jy": 16.8e-6,
    "Jz": 29.8e-6,
    "a": 0.03253,
    "c": 0.00705,
    "fmax": 0.12,
    "k1": -5.139e-6,
    "k2": 2.2414e-8,
    "rise": 1 / 0.136,
    "fall": 0.0,
    "fall2": 1 / (2 * 0.108 * 1986.3),
    "Jr": 3.452e-8,
    "Dx": 0.0147,
    "Dy": 0.0147,
    "Dz": 0.0128,
}
SETS: dict[str, dict[str, float]] = {
    "crazyflie": IDENTIFIED | {"rise": 16.0, "fall": 16.0, "fall2": 0.0},
    "crazyflow": IDENTIFIED,
    "gym": {
        "m": 0.027,
        "Jx": 14e-6,
        "Jy": 14e-6,
        "Jz": 21.7e-6,
        "a": 0.0281,
        "c": 0.02513,
        "fmax": 0.149,
        "k1": 0.0,
        "k2": 2.88e-8,
        "rise": AT_ONCE,
        "fall": AT_ONCE,
        "fall2": 0.0,
        "Jr": 0.0,
        "Dx": 0.00557,
        "Dy": 0.00557,
        "Dz": 0.00625,
    },
    "rotorpy": {
        "m": 0.03,
        "Jx": 14.3e-6,
        "Jy": 14.3e-6,
        "Jz": 28.9e-6,
        "a": 0.0304,
        "c": 0.0339,
        "fmax": 0.144,
        "k1": 0.0,
        "k2": 2.3e-8,
        "rise": 1 / 0.072,
        "fall": 1 / 0.072,
        "fall2": 0.0,
        "Jr": 0.0,
        "Dx": 0.00733,
        "Dy": 0.00733,
        "Dz": 0.0054,
    },
    "crazys": {
        "m": 0.027,
        "Jx": 16.57e-6,
        "Jy": 16.57e-6,
        "Jz": 29.26e-6,
        "a": 0.0325,
        "c": 0.00446,
        "fmax": 0.16,
        "k1": 0.0,
        "k2": 1.7147e-8,
        "rise": 80.0,
        "fall": 40.0,
        "fall2": 0.0,
        "Jr": 0.0,
        "Dx": 0.00838,
        "Dy": 0.00838,
        "Dz": 0.0,
    },
    "hummingbird": {
        "m": 0.5,
        "Jx": 3.65e-3,
        "Jy": 3.68e-3,
        "Jz": 7.03e-3,
        "a": 0.17 / math.sqrt(2),
        "c": 0.0244,
        "fmax": 12.5,
        "k1": 0.0,
        "k2": 5.57e-6,
        "rise": 200.0,
        "fall": 200.0,
        "fall2": 0.0,
        "Jr": 0.0,
        "Dx": 0.223,
        "Dy": 0.223,
        "Dz": 0.435,
    },
}


def build(n):
    return model_spec("quadrotor.xml")


def fields(model, p):
    if p.fade > 1.0:
        raise ScenarioError(
            f"quadrotor's fade is {p.fade:g}: "
            "give the share of its thrust that rotor 1 loses, 0 to 1"
        )
    for name in ("rise", "fall", "fall2", "Jr", "Dx", "Dy", "Dz", "lift"):
        if getattr(p, name) < 0.0:
            raise ScenarioError(f"quadrotor's {name} is {getattr(p, name):g}: give 0 or more")
    body = model.body("machine").id
    ball = model.body("payload").id
    rotors = [model.actuator(name).id for name in NAMES]
    radius = math.cbrt(3.0 * p.payload / (4.0 * math.pi * STEEL_DENSITY))
    yield Field("body_mass", [body, ball], (p.m, p.payload))
    yield Field("body_inertia", body, (p.Jx, p.Jy, p.Jz))
    yield Field("body_inertia", ball, (0.4 * p.payload * radius**2,) * 3)
    yield Field("body_user", body, (p.Dx, p.Dy, p.Dz))
    yield Field("body_pos", ball, (0.0, 0.0, -p.lp))
    yield Field("actuator_ctrlrange", rotors, (0.0, p.fmax))
    yield Field("actuator_gear", rotors, [(0.0, 0.0, 1.0, 0.0, 0.0, -spin * p.c) for spin in SPINS])
    yield Field("actuator_user", rotors, [rotor(p, i) for i in range(len(SPINS))])
    yield Field(
        "site_pos",
        [model.site(name).id for name in NAMES],
        [(p.a * x, p.a * y, 0.0) for x, y in PLACES],
    )
    yield Field("opt.gravity", 2, -p.grav)
    yield from shapes(model, p.a, max(radius, MIN_RADIUS))


def rotor(p, i):
    """Return the numbers of a rotor, by index, as a ROTOR."""
    carried = min(max(p.lift * (p.m + p.payload) * p.grav / 4, 0.0), p.fmax)
    if carried:
        start = (math.sqrt(p.k1 * p.k1 + 4.0 * p.k2 * carried) - p.k1) / (2.0 * p.k2)
    else:
        start = 0.0
    numbers = {
        "linear": p.k1,
        "square": p.k2,
        "rise": p.rise,
        "fall": p.fall,
        "fall2": p.fall2,
        "inertia": p.Jr,
    }
    numbers |= {"spin": SPINS[i], "fade": p.fade if i == 0 else 0.0, "sag": p.sag, "start": start}
    return [numbers.get(name, 0.0) for name in ROTOR.names or ()]


def shapes(model, a, radius):
    """Yield the fields of what is seen: a body of the size of its arms, and the payload."""
    scale = a / LEVER
    for i, (x, y) in enumerate(PLACES, 1):
        yield from geom_fields(
            model, f"motor{i}", (a * x, a * y, 0.003 * scale), (1, 0.007 * scale)
        )
        yield from geom_fields(
            model, f"disc{i}", (a * x, a * y, 0.0105 * scale), (0, 0.0231 * scale)
        )
    for name in ("arm13", "arm24"):
        yield from geom_fields(model, name, size=(1, math.sqrt(2.0) * a))
    for name, size in (("board", (0.015, 0.015, 0.003)), ("battery", (0.012, 0.009, 0.0035))):
        for axis, length in enumerate(size):
            yield from geom_fields(model, name, size=(axis, length * scale))
    yield from geom_fields(model, "battery", (0.0, 0.0, 0.006 * scale))
    yield from geom_fields(model, "nose", (0.0165 * scale, 0.0, 0.0))
    yield from geom_fields(model, "ball", size=(0, radius))


def reach(p: Values) -> tuple[float, ...]:
    """Return the largest force in any direction, three times, N, and the largest torque about each
    axis, N m.
    """
    return (4.0 * p.fmax,) * 3 + (4.0 * p.fmax * p.a, 4.0 * p.fmax * p.a, 4.0 * p.fmax * p.c)


QUADROTOR = Plant(
    name="quadrotor",
    label="Quadrotor",
    # kg, kg m^2, kg m^2, kg m^2, m, m, N, N s/rad, N s^2/rad^2, 1/s, 1/s, 1/rad, kg m^2, N s/m, N
    # s/m, N s/m, 1/N, 1, kg, m, 1, m/s^2
    parameters={
        **SETS["crazyflie"],
        "sag": 0.0,
        "fade": 0.0,
        "payload": 0.0,
        "lp": 0.03,
        "lift": 1.0,
        "grav": 9.81,
    },
    sets=SETS,
    mass="m",
    above_zero=("Jx", "Jy", "Jz", "a", "c", "fmax", "k2"),
    unit="m",
    mixed=("m", "m", "m", "rad", "rad", "rad"),
    x0=(0.2, -0.2, HOVER - 0.2, 0.0, 0.0, 0.4),
    rest=(0.0, 0.0, HOVER, 0.0, 0.0, 0.0),
    n=6,
    sizes=(6, 6),
    pose="heading",
    build=build,
    fields=fields,
    nominal=NominalModel(build, fields),
    added={"payload": "kg", "fade": "", "sag": "1/N"},
    uncertain={"m": (0.8, 1.2), "payload": (0.0, 0.006), "fade": (0.0, 0.1)},
    direct=True,
    limits=reach(Values(**SETS["crazyflie"])),
    reach=reach,
    jumps={"mild": {"m": 1.1}, "hard": {"m": 1.3}},
)
