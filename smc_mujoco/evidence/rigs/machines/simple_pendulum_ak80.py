"""Torque-limited simple pendulum on an AK80-6 motor, which takes torques.

The masses and lengths of its links matter only through the inertia J and the moment m c of their
weight. The plant has a point mass (m c)^2 / J at the distance J / (m c) instead. Positions are 0
hanging in records, and 0 upright in the plant.
"""

import math

from smc_mujoco.control.law import library_law
from smc_mujoco.control.source import SHIPPED, GainSearch
from smc_mujoco.identification.published_rig import PublishedRig
from smc_mujoco.identification.records import Columns
from smc_mujoco.identification.rig import Quantity
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.hardware.friction import Coulomb
from smc_mujoco.mechanisms.plant import plant

SOURCE = "dfki-ric-underactuated-lab/torque_limited_simple_pendulum (BSD-3)"
ORIGIN = f"between the values found in runs of {SOURCE}"


def machine(q):
    """Return the fields of a scenario."""
    l = q.inertia / q.mass_moment
    return {
        "plant": plant("inverted_pendulum", m=q.mass_moment / l, l=l, b=q.viscous),
        "friction": Coulomb(q.coulomb),
        "sensor": Encoder(counts=4096),
        "u_max": q.torque_limit,
        "control_period": 2e-3,
        "x0": -math.pi,
    }


# Found by smc.tune on the quantities below: 96 sets of gains, seed 0, starts within 20 % of 0.3
# rad, |u| <= 6 N m.
SEARCH = GainSearch(rule="differential evolution", evaluations=96)
LAWS = (
    library_law("observer_free", lam=2.749, k1=18.27).sourced(SHIPPED, SEARCH),
    library_law("classical", k=1.578, c=16.55).sourced(SHIPPED, SEARCH),
    library_law("boundary_layer", k=4.388, c=35.09, phi=0.3036).sourced(SHIPPED, SEARCH),
    library_law("adaptive", gamma=2.477, c=19.77).sourced(SHIPPED, SEARCH),
    library_law("super_twisting", k1=1.283, k2=6.288, c=6.356).sourced(SHIPPED, SEARCH),
    library_law("pid", kp=341.0, ki=1107.0, kd=4.143, tt=0.1287).sourced(SHIPPED, SEARCH),
)
SIMPLE_PENDULUM = PublishedRig(
    name="simple_pendulum_ak80",
    label="Torque-limited simple pendulum with an AK80-6 motor",
    quantities={
        "inertia": Quantity(0.1635, "kg m^2", ORIGIN, 1e-3, 10.0),
        "mass_moment": Quantity(0.33, "kg m", ORIGIN, 1e-3, 10.0),
        "viscous": Quantity(0.0, "N m s/rad", "part of coulomb in the published values", 0.0, 10.0),
        "coulomb": Quantity(0.21, "N m", ORIGIN, 0.0, 10.0),
        "torque_limit": Quantity(12.0, "N m", f"AK80-6, in {SOURCE}", 0.1, 100.0),
    },
    machine=machine,
    columns=Columns(time="time", x=("position",), u="torque", offset=(math.pi,)),
    identified_from=("ddp", "direct_collocation"),  # by their source
    free=("inertia", "mass_moment", "viscous", "coulomb"),
    window=1.0,
    ensemble=(  # ends of the values found in runs of the source
        {"inertia": 0.161, "mass_moment": 0.318, "coulomb": 0.18},
        {"inertia": 0.166, "mass_moment": 0.342, "coulomb": 0.24},
        {"inertia": 0.161, "mass_moment": 0.342, "coulomb": 0.18},
        {"inertia": 0.166, "mass_moment": 0.318, "coulomb": 0.24},
    ),
    laws=LAWS,
    x0=(0.3,),
    about=(
        "Records of open loops at several rates. The parameter sets are the ends of the values "
        "published for it. The laws of a ranking were tuned on the middle of these, by one rule."
    ),
)
