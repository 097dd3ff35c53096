"""Logs of machines whose numbers are known, by MuJoCo alone at steps of 0.1 ms: a PD loop at the
log's rate, encoder counts, white noise, a delay from command to force, a gain and an offset of it.

Nothing of the package is used, so what identification finds is compared with another simulation.
"""

from collections.abc import Callable, Mapping, Sequence

import mujoco
import numpy as np

STEP = 1e-4  # s
RATE_FILTER = 4e-3  # s, of the loop's speed


def chain(lengths: Sequence[float], masses: Sequence[float]) -> str:
    """Return the MJCF of links in a row on hinges j1, j2, ..., each with a motor."""
    text, close, motors = "", "", ""
    for i, (length, mass) in enumerate(zip(lengths, masses, strict=True), 1):
        place = f'pos="0 0 -{lengths[i - 2]}"' if i > 1 else ""
        text += (
            f'<body {place}><joint name="j{i}" axis="0 1 0"/>'
            f'<geom type="capsule" fromto="0 0 0 0 0 -{length}" size=".02" mass="{mass}" '
            'contype="0" conaffinity="0"/>'
        )
        close += "</body>"
        motors += f'<motor joint="j{i}"/>'
    return (
        f'<mujoco model="chain"><compiler angle="radian"/><worldbody>{text}{close}</worldbody>'
        f"<actuator>{motors}</actuator></mujoco>"
    )


def compiled(
    xml: str,
    numbers: Mapping[str, Mapping[str, float]],
    masses: Mapping[str, float],
    soft: bool = False,
) -> mujoco.MjModel:
    """Return the model with numbers of joints, hard dry friction (or `soft`, MuJoCo's default), and
    factors on bodies' masses.
    """
    spec = mujoco.MjSpec.from_string(xml)
    for joint in spec.joints:
        for name, value in numbers.get(joint.name, {}).items():
            field = getattr(joint, name)
            if np.ndim(field):
                field[:] = 0.0
                field[0] = value
            else:
                setattr(joint, name, value)
        if not soft:
            joint.solref_friction[:] = (2.0 * STEP, 1.0)
            joint.solimp_friction[:] = (0.99999, 0.99999, 0.001, 0.5, 2.0)
    spec.option.timestep = STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model = spec.compile()
    for body, factor in masses.items():
        model.body_mass[model.body(body).id] *= factor
        model.body_inertia[model.body(body).id] *= factor
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def split(truth: Mapping[str, float], joints: Sequence[str]) -> dict[str, dict[str, float]]:
    """Return joint -> the numbers that the model has, from paths."""
    numbers_by_part: dict[str, dict[str, float]] = {}
    for path, value in truth.items():
        joint, _, kind = path.rpartition(".")
        if joint in joints and kind in ("damping", "frictionloss", "armature", "stiffness"):
            numbers_by_part.setdefault(joint, {})[kind] = value
    return numbers_by_part


def log(
    xml: str,
    truth: Mapping[str, float],
    reference: Callable[[float], tuple[np.ndarray, np.ndarray]],
    kp: float | Sequence[float],
    kd: float | Sequence[float],
    *,
    joints: Sequence[str] = ("j1",),
    measured: Sequence[str] = (),
    rate: float = 500.0,
    duration: float = 8.0,
    counts: float = 4096.0,
    noise: float = 2e-4,
    x0: Sequence[float] | None = None,
    seed: int = 0,
    masses: Mapping[str, float] | None = None,
    soft: bool = False,
) -> dict[str, np.ndarray]:
    """Return the columns of a log: t, x and u of one joint, or x_JOINT and u_JOINT of each.

    `reference`: function of t that returns positions and speeds, (joints,) each.
    """
    seen = [*joints, *measured]
    model = compiled(xml, split(truth, seen), masses or {}, soft)
    data = mujoco.MjData(model)
    places = np.array([model.joint(joint).qposadr[0] for joint in seen])
    hinges = np.array([model.joint(joint).type[0] == mujoco.mjtJoint.mjJNT_HINGE for joint in seen])
    quantum = np.where(hinges, 2.0 * np.pi, 1.0) / counts
    gain = np.array([truth.get(f"{joint}.gain", 1.0) for joint in joints])
    offset = np.array([truth.get(f"{joint}.offset", 0.0) for joint in joints])
    m = len(joints)
    rng = np.random.default_rng(seed)
    stride = round(1.0 / rate / STEP)
    late = round(truth.get("input_delay", 0.0) / STEP)
    if x0 is not None:
        data.qpos[places] = x0
    mujoco.mj_forward(model, data)
    command = np.zeros(m)
    commands: list[np.ndarray] = []
    rates = np.zeros(m)
    last: np.ndarray | None = None
    share = 1.0 - np.exp(-1.0 / rate / RATE_FILTER)
    times, positions, commanded = [], [], []
    for k in range(round(duration / STEP)):
        if k % stride == 0:
            y = data.qpos[places] + noise * rng.standard_normal(len(seen))
            y = quantum * np.floor(y / quantum + 0.5)
            if last is not None:
                rates = rates + share * ((y[:m] - last) * rate - rates)
            last = y[:m].copy()
            r, dr = reference(k * STEP)
            command = np.asarray(kp) * (r - y[:m]) + np.asarray(kd) * (dr - rates)
            times.append(k * STEP)
            positions.append(y)
            commanded.append(command)
        commands.append(command)
        data.ctrl[:] = (gain * commands[k - late] if k >= late else 0.0) + offset
        mujoco.mj_step(model, data)
    x, u = np.array(positions), np.array(commanded)
    columns = {"t": np.array(times)}
    for i, joint in enumerate(seen):
        columns["x" if len(seen) == 1 else f"x_{joint}"] = x[:, i]
    for i, joint in enumerate(joints):
        columns["u" if len(seen) == 1 else f"u_{joint}"] = u[:, i]
    return columns


def servo_log(
    xml: str, truth: Mapping[str, float], t: np.ndarray, u: np.ndarray, seed: int = 0
) -> dict[str, np.ndarray]:
    """Return a log of the joint j1, whose `<position>` or `<pid>` gets set-points u, (K,) as t."""
    model = compiled(xml, split(truth, ["j1"]), {})
    data = mujoco.MjData(model)
    rng = np.random.default_rng(seed)
    stride = round((t[1] - t[0]) / STEP)
    quantum = 2.0 * np.pi / 8192.0
    data.qpos[0] = u[0]
    x = np.zeros(len(t))
    late = round(truth.get("input_delay", 0.0) / STEP)
    for k in range(len(u)):
        y = data.qpos[0] + 2e-4 * rng.standard_normal()
        x[k] = quantum * np.floor(y / quantum + 0.5)
        for step in range(k * stride, (k + 1) * stride):
            data.ctrl[0] = u[max(step - late, 0) // stride]
            mujoco.mj_step(model, data)
    return {"t": t, "x": x, "u": u}


def sines(
    centre: Sequence[float], amplitudes: Sequence[float], frequencies: Sequence[float]
) -> Callable[[float], tuple[np.ndarray, np.ndarray]]:
    """Return a reference: a sum of sines (amplitudes in rad, frequencies in Hz) for each joint."""
    middle = np.asarray(centre, float)
    w = 2.0 * np.pi * np.asarray(frequencies)
    phase = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, (len(middle), len(w)))
    detuned = 1.0 + 0.07 * np.arange(len(middle))[:, None]
    size = np.asarray(amplitudes)

    def value(t: float) -> tuple[np.ndarray, np.ndarray]:
        soft = min(1.0, t / 0.5)
        p = w * detuned * t + phase
        moved = soft * (size * np.sin(p)).sum(axis=1)
        return middle + moved, soft * (size * w * detuned * np.cos(p)).sum(axis=1)

    return value


def chirp(
    centre: Sequence[float], amplitude: float, f0: float, f1: float, duration: float
) -> Callable[[float], tuple[np.ndarray, np.ndarray]]:
    """Return a reference whose frequency rises from f0 to f1, Hz."""
    middle = np.asarray(centre, float)

    def value(t: float) -> tuple[np.ndarray, np.ndarray]:
        k = (f1 - f0) / duration
        p = 2.0 * np.pi * (f0 * t + 0.5 * k * t * t) + 0.9 * np.arange(len(middle))
        speed = amplitude * np.cos(p) * 2.0 * np.pi * (f0 + k * t)
        return middle + amplitude * np.sin(p), speed

    return value


def stairs(
    centre: Sequence[float], step: float, hold: float
) -> Callable[[float], tuple[np.ndarray, np.ndarray]]:
    """Return a reference of steps of `step` rad that last `hold` s, with ramps of 0.15 s."""
    middle = np.asarray(centre, float)
    levels = np.array([0, 1, 2, 3, 4, 3, 2, 1]) - 2.0
    signs = (-1.0) ** np.arange(len(middle))

    def value(t: float) -> tuple[np.ndarray, np.ndarray]:
        k = int(t / hold)
        s = min(1.0, (t - k * hold) / 0.15)
        a, b = levels[k % 8], levels[(k + 1) % 8]
        r = a + (b - a) * s * s * (3.0 - 2.0 * s)
        dr = (b - a) * 6.0 * s * (1.0 - s) / 0.15 * (s < 1.0)
        return middle + step * r * signs, step * dr * signs

    return value
