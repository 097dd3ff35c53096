"""QUBE-Servo (first version): a rotary pendulum upright, driven by a voltage, as identified from
public records.

The records are of 20 s at 500 Hz, from decargroup/closed_loop_koopman (MIT, 2023). The pendulum's
mass is the published one. One mass must be known, because records of motions under a voltage
determine the others only relative to it.
"""

import math

import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.evidence.rigs.controllers import rotary, state_feedback
from smc_mujoco.identification.published_rig import PublishedRig
from smc_mujoco.identification.records import STATE_SAMPLES, Columns, Record, rate
from smc_mujoco.identification.rig import Quantity
from smc_mujoco.mechanisms.hardware.drives import DCMotor
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.plant import plant

START_TIME = 2.0  # s: before, the pendulum is caught
BARS = 9  # of the commutator; its two brushes bridge two bars at 18 places a turn
PITCH = math.tau / BARS  # rad
ANGLE_COUNT = 80  # that are tried in a pitch, 0.5 degrees apart; chosen
FRICTION_SPEED = 0.05  # rad/s, at which dry friction nears its limit in `zero`; chosen
MIN_PROBABILITY = (
    0.95  # of the angles within a sixteenth of a pitch: below it a brush's is not known; chosen
)
PERIOD, STEP = 2e-3, 5e-4  # s; the fit is the same to 0.3 % at half the step
ORIGIN = (
    "identified here from eight records by least squares in closed loop, after a wide search with "
    "two of them"
)
RIPPLE_ORIGIN = (
    "identified here from eight records in open loop, by the likelihood of a Kalman filter"
)
PUBLISHED = "Quanser, QUBE-Servo 2, as in BlueRiverTech/quanser-openai-driver (MIT)"
DRIVER = {
    "pendulum_length": 0.129,
    "arm_length": 0.085,
    "arm_inertia": 4e-6 + 0.095 * 0.085**2 / 12,
    "arm_damping": 5e-5,
    "arm_friction": 0.0,
    "pendulum_damping": 2.5e-6,
    "torque_per_volt": 0.042 / 8.4,
    "back_emf": 0.042,
    "slope_x": 0.0,
    "slope_y": 0.0,
    "encoder_offset": 0.0,
    "delay": 0.0,
    "ripple": 0.0,
}


def machine(q):
    """Return the fields of a scenario. The pendulum is a uniform rod."""
    half = q.pendulum_length / 2
    furuta = plant(
        "furuta",
        J=q.arm_inertia,
        L=q.arm_length,
        m=q.pendulum_mass,
        l=half,
        Jc=q.pendulum_mass * half**2 / 3,
        b=q.arm_damping,
        bq=q.pendulum_damping,
        cf=q.arm_friction,
        tx=q.slope_x,
        ty=q.slope_y,
    )
    motor = DCMotor(
        resistance=q.back_emf / q.torque_per_volt,
        inductance=0.0,
        torque_constant=q.back_emf,
        gear=1.0,
        rotor_inertia=0.0,
        voltage=10.0,
        current=math.inf,
        command="voltage",
        bars=BARS,
        ripple=q.ripple if q.brush else 0.0,
        bridge=q.bridge,
        bridge_2=q.bridge_2,
        brush=q.brush,
        brush_2=q.brush + q.brush_gap,
    )
    return {
        "plant": furuta,
        "actuator": motor,
        "sensor": Encoder(counts=2048, bias=q.encoder_offset),
        "control_period": PERIOD,
        "physics_step": STEP,
        "input_delay": STEP * round(q.delay / STEP),
        "x0": (0.0, 0.0),
    }


def ripples(q, x: Array) -> Array:
    """Return the share of the torque that the commutator adds at angles x of the motor, with a
    brush at 0.
    """
    pairs = ((0.0, q.bridge), (q.brush_gap, q.bridge_2))
    return q.ripple * sum(
        np.exp((np.cos(BARS * (x - centre)) - 1.0) / (BARS * wide) ** 2) for centre, wide in pairs
    )


def zero(q, record: Record) -> dict[str, float]:
    """Return the angle of a brush in a record, whose arm was somewhere when its encoder was
    switched on; {} if unknown.

    The arm's balance, with the measured motion, gives the torque that a motor without ripple lacks.
    Its terms go through the same cubics, and what inertia and friction explain is taken out. Each
    angle of a brush explains a part of the rest. The angle is known if those near it have
    MIN_PROBABILITY among all angles and "no ripple". For short records that is too sure: of 12
    angles from quarters of the public records 4 are wrong.
    """
    theta, alpha, u = (
        record[name][round(START_TIME / PERIOD) :] for name in ("theta", "alpha", "plant_input")
    )
    if not q.ripple or len(u) <= 2 * STATE_SAMPLES or not np.ptp(u):
        return {}
    x, v, a = (rate(theta, PERIOD, order) for order in range(3))
    pendulum, speed, acceleration = (rate(alpha, PERIOD, order) for order in range(3))
    pull = q.pendulum_mass * q.arm_length * q.pendulum_length / 2
    torque = q.torque_per_volt * (np.roll(u, 1) - q.back_emf * v)  # held after a delay of 1 ms
    inertia = q.arm_inertia + q.pendulum_mass * q.arm_length**2
    moved = inertia * a + pull * (np.cos(pendulum) * acceleration - np.sin(pendulum) * speed**2)
    lacks = moved - rate(torque, PERIOD, 0)
    smooth, _ = np.linalg.qr(
        np.column_stack([np.ones(len(x)), x, v, np.tanh(v / FRICTION_SPEED), a, acceleration])
    )
    angles = PITCH * np.arange(1, ANGLE_COUNT + 1) / ANGLE_COUNT
    gaps = np.vstack(
        [lacks, lacks - rate(ripples(q, x - angles[:, np.newaxis]) * torque, PERIOD, 0)]
    )
    gaps -= gaps @ smooth @ smooth.T
    misfits = np.log(np.linalg.norm(gaps, axis=1))
    even, *likely = np.exp((misfits.min() - misfits) * _independent(gaps[0]))
    best = int(np.argmax(likely))
    reach = ANGLE_COUNT // 16
    nearby = np.sum(np.roll(likely, reach - best)[: 2 * reach + 1])
    if nearby > MIN_PROBABILITY * (even + np.sum(likely)):
        return {"brush": float(angles[best])}
    return {}


def _independent(values: Array) -> float:
    """Return how many independent samples have as precise a mean as these correlated ones, (K,)."""
    from scipy.signal import correlate

    correlation = correlate(values, values)[len(values) - 1 :]
    until = np.argmax(correlation < 0.0)
    return float(len(values) * correlation[0] / (2.0 * correlation[:until].sum() - correlation[0]))


def commands(record: Record, first: int) -> Array:
    """Return what the records' controller adds to the replay's feedback, V, (K,).

    That is the feedforward, the effect of the pendulum's reference, and the effect of the states of
    the controller's filters at the start. The controller is linear, so these effects can be
    computed beforehand.
    """
    from scipy.signal import lfilter

    gains = state_feedback.defaults
    n = len(record["t"]) - first
    lag = 1.0 + gains["cutoff"] * PERIOD
    target = record.get("target_alpha", np.zeros(first + n))

    def filtered(z: Array) -> Array:
        return np.asarray(lfilter((gains["cutoff"], -gains["cutoff"]), (lag, -1.0), z - z[0]))

    arm, pendulum = (
        filtered(z[: first + 1])[-1]
        for z in (record["theta"] - record["target_theta"], record["alpha"] - target)
    )
    derivatives = (gains["kd"] * arm + gains["kd_free"] * pendulum) * lag ** -np.arange(float(n))
    moved = gains["kp_free"] * target[first:] + gains["kd_free"] * filtered(target[first:])
    return record.get("feedforward", np.zeros(first + n))[first:] + derivatives - moved


TORQUE_PER_VOLT = 5.07081e-3  # N m/V, of the quantities below
# V/rad and V s/rad: the surface of least quadratic cost of the quantities below, with the weights
# of `rotary_swing_up`
SURFACE = {"c1": -4.40969, "c2": -49.8874, "c3": -2.08797, "c4": -4.10042}


NAMES = (
    "pendulum_length",
    "arm_length",
    "arm_inertia",
    "arm_friction",
    "pendulum_damping",
    "torque_per_volt",
    "back_emf",
    "slope_x",
    "slope_y",
    "encoder_offset",
)
# drawn from the errors and correlations of the quantities below, from a jackknife over blocks of 2
# s
ENSEMBLE = (
    (0.11618, 0.0815511, 0.000128719, 0.000269367, 1.38039e-06, 0.00510406, 0.0566222, -0.00631237,
     0.00680552, -0.00287206),
    (0.115732, 0.081369, 0.000123645, 0.000266133, 0, 0.00494562, 0.0563888, -0.0064882,
     0.00822018, -0.00259226),
    (0.116028, 0.081595, 0.00012604, 0.000278892, 2.15922e-06, 0.00502255, 0.0516399, -0.00693806,
     0.00737641, -0.00311616),
)  # fmt: skip
QUBE_SERVO = PublishedRig(
    name="qube_servo",
    label="QUBE-Servo with rotary pendulum, identified from public records",
    quantities={
        "pendulum_mass": Quantity(0.024, "kg", PUBLISHED, 1e-4),
        "pendulum_length": Quantity(0.116104, "m", ORIGIN, 0.01, 1.0),
        "arm_length": Quantity(0.0815281, "m", ORIGIN, 0.01, 1.0),
        "arm_inertia": Quantity(0.000127545, "kg m^2", ORIGIN, 1e-6, 1e-2),
        "arm_damping": Quantity(
            0.0, "N m s/rad", "part of back_emf: records cannot separate the two", 0.0, 1.0
        ),
        "arm_friction": Quantity(0.000267993, "N m", ORIGIN, 0.0, 0.1),
        "pendulum_damping": Quantity(1.76875e-6, "N m s/rad", ORIGIN, 0.0, 0.1),
        "torque_per_volt": Quantity(TORQUE_PER_VOLT, "N m/V", ORIGIN, 1e-4, 1.0),
        "back_emf": Quantity(0.0551037, "V s/rad", ORIGIN, 1e-4, 1.0),
        "slope_x": Quantity(-0.0065777, "", ORIGIN, -0.2, 0.2),
        "slope_y": Quantity(0.0074647, "", ORIGIN, -0.2, 0.2),
        "encoder_offset": Quantity(-0.00286933, "rad", ORIGIN, -0.1, 0.1),
        "ripple": Quantity(0.112, "", RIPPLE_ORIGIN, 0.0, 1.0),
        "bridge": Quantity(0.0169, "rad", RIPPLE_ORIGIN, 1e-3, 0.3),
        "bridge_2": Quantity(0.0079, "rad", RIPPLE_ORIGIN, 1e-3, 0.3),
        "brush_gap": Quantity(0.322, "rad", RIPPLE_ORIGIN, 0.0, PITCH),
        "brush": Quantity(
            0.0,
            "rad",
            "part of each record, see `zero`; 0: not known, so the torque is even",
            0.0,
            PITCH,
        ),
        "delay": Quantity(
            1e-3, "s", "chosen among multiples of 0.5 ms by the fit on records 00 and 24", 0.0, 2e-3
        ),
    },
    machine=machine,
    controller=state_feedback(),
    columns=Columns(
        x=("theta", "alpha"),
        u="plant_input",
        reference="target_theta",
        other_references=("target_alpha",),
    ),
    commands=commands,
    zero=zero,
    start=START_TIME,
    score_from=4.0,
    window=0.25,
    identified_from=("00", "06", "12", "18", "24", "30", "36", "42"),
    free=NAMES,
    published={
        "driver": DRIVER | {"source": f"{PUBLISHED}: rotor 4e-6 kg m^2, arm's inertia m r^2/12"},
        "driver_damped": DRIVER
        | {"arm_damping": 5e-4, "pendulum_damping": 5e-5}
        | {"source": f"{PUBLISHED}, damping between the published ones"},
        "quanser": DRIVER
        | {"arm_inertia": 4e-6 + 0.095 * 0.085**2 / 3}
        | {
            "source": (
                "arm's inertia m r^2/3 as in Quanser's qube3_rotpen_param.m (no licence stated): "
                "the rig's own controller lets it fall"
            )
        },
    },
    ensemble=tuple(dict(zip(NAMES, values, strict=True)) for values in ENSEMBLE),
    laws=(*rotary(TORQUE_PER_VOLT, SURFACE), state_feedback()),
    x0=(0.0, 0.1),
    about=(
        "Records: decargroup/closed_loop_koopman (MIT, 2023). Identified on eight records; 11 was "
        "not used. The angle of the brushes is read from each record. The laws of a ranking have "
        "the gains of scene furuta, in volts, and were not tuned on the twin; the machine’s own "
        "controller was made for it."
    ),
)
