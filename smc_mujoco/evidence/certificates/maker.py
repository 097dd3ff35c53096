"""Certificates of laws on plants: which theorem holds, by which margins, from where, and how far d can push.

    scenario = smc.Scenario(plant="duffing", law="observer_free")
    certificate = smc.certify(scenario, within=smc.Uncertainty(disturbance=1.0))
    certificate.bound                               # |x| in the end, m, under every |d| <= 1 N
    certificate.save("duffing.json")                # smc-mujoco certify --check duffing.json proves it again

The plant is its equation M x'' = phi(x) - D(x) x' + u + d, integrated exactly, and the law acts at every instant. What
else a machine does is in `Certificate.leaves_out`.
"""

import functools
import itertools
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.optimize import minimize

from smc_mujoco.analysis.worst_case.uncertainty import Uncertainty
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.extras import extra
from smc_mujoco.evidence.certificates import search
from smc_mujoco.evidence.certificates.certificate import Certificate, finite
from smc_mujoco.evidence.certificates.loops import Loop, loop_of
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Constant, Pulse, Sine, Step

REACH = {"rad": lambda plant: math.pi, "m": lambda plant: 3.0 * max(map(abs, plant.x0))}  # of a grid in x: chosen
TIGHT = 1e-4  # share by which a margin is stated below the true one
BOXES = (64, 256, 1024, 4096)  # tried in turn
ROUNDED = 0.98  # factor on the largest set that a condition allows: chosen
LINEAR = ("lqr", "pid")
LAWS = ("observer_free", "boundary_layer", *LINEAR, "classical", "terminal", "super_twisting")
PLANTS = ("inverted_pendulum", "duffing", "van_der_pol", "pendulum_network", "inverted_pendulum_network")


def certify(scenario: Scenario, within: Uncertainty | None = None) -> Certificate:
    """Return what is proven of a scenario's law on its plant, checked in ball arithmetic.

    Laws: observer_free, boundary_layer, lqr and pid (without an integral), classical, terminal, super_twisting; all
    without the nominal model and a surface of another file. Plants: the pendulums and their networks, duffing and
    van_der_pol, with any parameters and mismatch, at rest at 0.

    Args:
      within: the class of disturbances, as of `worst_case`, beside those of the scenario: bounds of |d| and, for
        super_twisting, of |d'|. None: the scenario's own disturbance and no other.

    Raises:
      ScenarioError: a pair for which there is no theorem, a disturbance without a bound, or a class with more than
        disturbances.
      MissingPackageError: python-flint is not installed.
    """
    with extra("proof", "smc.certify"):
        import flint  # noqa: F401

        from smc_mujoco.evidence.certificates import checker
    if not isinstance(scenario, Scenario):
        raise ScenarioError(f"certify is about a Scenario, not {shown(scenario)}: give smc.Scenario(...)")
    _check(scenario)
    plant, law = scenario.plant, scenario.law
    d0, rate = (own + more for own, more in zip(_bounds(scenario), _class(within), strict=True))
    u_max = scenario.limits[0]
    values = {name: float(value) for name, value in vars(plant.values(scenario.mismatch)).items()}
    document: dict[str, Any] = {
        "format": checker.FORMAT,
        "plant": {"name": plant.name, "n": plant.n, "parameters": values, "mechanism": scenario.mechanism},
        "law": {"name": law.name, "gains": {name: finite(value) for name, value in law.gains.items()}},
        "u_max": finite(u_max),
        "unit": plant.unit,
        "disturbance": d0,
        "slope": finite(rate),
        "leaves_out": left_out(scenario),
    }
    document["parts"] = _parts(document, scenario, checker)
    document["seal"] = checker.seal(document)
    certificate = Certificate(data=document)
    certificate.check()
    return certificate


def left_out(scenario: Scenario) -> dict[str, str]:
    """Return what the theorems leave out -> what this scenario has of it, in words."""
    s = scenario.resolved
    sizes = {"position": s.noise.position, "velocity": s.noise.velocity}
    noise = [f"{name} {value:g}" for name, value in sizes.items() if value] + ["chosen errors"] * any(s.noise.errors)
    return {
        "sampling": f"the law acts every {1e3 * s.control_period:g} ms",
        "delay": f"{1e3 * s.input_delay:g} ms" if s.input_delay else "none here",
        "noise": ", ".join([*noise, f"velocity {s.velocity.name}" if s.velocity else "", str(s.sensor or "")]).strip(
            ", "
        ),
        "dry friction": ", ".join(str(part) for part in s.friction) or "none here",
        "contact": s.contact.kind,
        "drive": ", ".join(str(part) for part in s.actuator) or "none here",
        "other parameters": f"a jump {s.jump}" if s.jump else "none here",
        "rounding": f"{s.integrator} in steps of {1e3 * s.physics_step:g} ms",
    }


def _check(scenario: Scenario) -> None:
    """Raise ScenarioError for a scenario that no theorem here is about."""
    plant, law = scenario.plant, scenario.law
    if law.name not in LAWS or law.function is None or plant.name not in PLANTS or plant.own:
        raise ScenarioError(
            f"there is no theorem for {law.name} on {plant.name}: certify one of {', '.join(LAWS)} on one of "
            f"{', '.join(PLANTS)}"
        )
    refused = {
        f"super_twisting on the {plant.n} pendulums of a network": law.name == "super_twisting" and plant.n > 1,
        "model='nominal'": scenario.resolved.model != "none",
        "a surface": scenario.surface is not None,
        "a feedforward": scenario.feedforward is not None,
        "a reference that is not 0": any(r != Constant(0.0) for r in scenario.references),
        "gains or bounds by channel": not law.uniform or len(set(scenario.limits)) > 1,
        "a motor's voltage as u": scenario.amplifier is not None,
        "pid with an integral": law.name == "pid" and law.gains["ki"] != 0.0,
        f"mechanism {scenario.mechanism!r}": scenario.mechanism != "equation" and plant.n == 1,
    }
    for what, there in refused.items():
        if there:
            raise ScenarioError(f"there is no theorem for {what}: certify a scenario without it")


def _bounds(scenario: Scenario) -> tuple[float, float]:
    """Return bounds of |d| and |d'| of a scenario's disturbance."""
    bound = slope = 0.0
    for signal in scenario.disturbance:
        if not isinstance(signal, Constant | Sine | Step | Pulse):
            raise ScenarioError(
                f"{type(signal).__name__} has no bound: leave it out, and give within=smc.Uncertainty(disturbance=...)"
            )
        bound += abs(signal.amplitude)
        if not isinstance(signal, Constant):
            slope += abs(signal.amplitude * signal.omega) if isinstance(signal, Sine) else math.inf
    return bound, slope


def _class(within: Uncertainty | None) -> tuple[float, float]:
    """Return the bounds of |d| and |d'| of a class."""
    if within is None:
        return 0.0, 0.0
    if not isinstance(within, Uncertainty):
        raise ScenarioError(f"within is {shown(within)}: give a class, such as smc.Uncertainty(disturbance=2.0)")
    if within != Uncertainty(disturbance=within.disturbance, slope=within.slope):
        raise ScenarioError("a certificate is about disturbances alone: give a class with disturbance and slope only")
    return within.disturbance, math.inf if within.slope is None else within.slope


def _parts(document: dict, scenario: Scenario, checker: Any) -> list[dict]:
    """Return the theorems of a law on a plant with their data."""
    plant, (loop, terms, law) = document["plant"], loop_of(document)
    if law.name == "super_twisting":
        return [_super_twisting(document, loop, terms, law)]
    parts = [_saturated(document, loop, terms, law, checker)]
    single, reach = plant["n"] == 1, REACH[scenario.plant.unit](scenario.plant)
    reaching = _reaching(document, loop, law, reach) if single and law.name in ("classical", "terminal") else None
    if reaching:
        parts.append(reaching)
    bounded = document["disturbance"] > 0.0 or not parts[0]["holds"]
    if single and bounded and law.name != "terminal" and _room(document, law) >= 0.0:
        box = (reaching["X"], reaching["S"]) if reaching else None
        e, f = checker.equation(plant), checker.feedback(document["law"], document["u_max"])
        proven = functools.partial(checker.falls, e, f, checker.arb(document["disturbance"]))
        if found := search.levels(loop, reach, _start(scenario, loop), proven, box):
            parts.append(_levels(document, loop, law, found, scenario))
    return parts


def _room(document: dict, law: SimpleNamespace) -> float:
    """Return u_max less the largest |u| of the law."""
    u_max = document["u_max"]
    if u_max is None or law.name in LINEAR:
        return 0.0
    return u_max - (law.lam if law.name == "observer_free" else law.k + getattr(law, "bound", 0.0))


def _part(theorem: str, conditions: list[dict], **data: Any) -> dict:
    holds = all(one["margin"] >= 0.0 for one in conditions)
    return {"theorem": theorem, "holds": holds, "conditions": conditions} | data


def _condition(name: str, margin: float, **data: Any) -> dict:
    return {"name": name, "margin": float(margin)} | data


def _saturated(document: dict, loop: Loop, terms: list[float], law: SimpleNamespace, checker: Any) -> dict:
    """Return the theorem of a saturated PD law: V and its conditions."""
    A, B, C, E, F = terms
    plant, kc = document["plant"], document["plant"]["parameters"].get("kc", 0.0)
    conditions = [
        _condition("damping", -abs(F) if F else E),
        _restoring(document, loop, terms, checker),
        _condition("actuator", _room(document, law)),
    ]
    if plant["n"] > 1:  # x sin x >= -0.217 x^2, so a real spring's torque may pull apart
        weakest = kc if plant["mechanism"] == "equation" else -0.2172336282112216 * abs(kc)
        conditions.append(_condition("coupling", weakest))
    if not loop.switches:
        conditions.append(_condition("local", loop.steep * loop.c - A - B))
    V = {"v^2": loop.M / 2.0, "sigma": 1.0 / loop.c, "cos x - 1": A, "x^2": -B / 2.0, "x^4": -C / 4.0}
    return _part("saturated PD", conditions, V=V | {"springs": kc / 2.0})


def _restoring(document: dict, loop: Loop, terms: list[float], checker: Any) -> dict:
    """Return the condition that the law's force exceeds the plant's, with boxes from 0 to infinity."""
    A, B, C, _, _ = terms
    tail = math.sqrt(max(B, 0.0) / -C) * 1.01 + 0.1 if C < 0.0 else 1.0
    tail = max(tail, 2.0 * math.pi if A else 0.0)
    x = np.linspace(0.0, 2.0 * tail, 20001)[1:]
    share = 1.0 - loop.phi(x) / loop.sigma(loop.c * x)
    least = min(1.0, float(share.min()), 1.0 if loop.switches else 1.0 - (A + B) / (loop.steep * loop.c))
    if least < 0.0 or C > 0.0 or (C == 0.0 and B > 0.0):
        at = float(x[share.argmin()]) if share.min() < 0.0 else _far(loop)
        return _condition("restoring", _share(loop, at), at=at)
    margin = least - TIGHT * max(abs(least), 0.1) * (least < 1.0)
    e, f = checker.equation(document["plant"]), checker.feedback(document["law"], document["u_max"])
    told = _condition("restoring", margin)
    for count in BOXES:
        edges = [float(f"{edge:.9g}") for edge in tail * np.linspace(0.0, 1.0, count + 1) ** 2]
        told["boxes"] = [*map(list, itertools.pairwise(edges)), [edges[-1], None]]
        try:
            checker.restoring(told, e, f)
        except checker.Refused:
            continue
        return told
    raise ScenarioError(f"found no boxes that prove a margin of {margin:g}: give other gains")


def _far(loop: Loop) -> float:
    """Return an x where the plant's force is larger than the law's, for a plant whose force grows without bound."""
    x = 1.0
    while _share(loop, x) >= 0.0:
        x *= 2.0
    return x


def _share(loop: Loop, x: float) -> float:
    return 1.0 - float(loop.phi(np.array(x))) / float(loop.sigma(np.array(loop.c * x)))


def _reaching(document: dict, loop: Loop, law: SimpleNamespace, reach: float) -> dict:
    """Return the largest set where s = 0 is surely reached, X = 0 if there is none."""
    room = law.k - loop.d0
    classical = law.name == "classical"

    def push(x):
        x = np.asarray(x)
        if classical:  # at the corner (x, -c x / 2), where v = -1.5 c x
            return np.abs(loop.phi(x) - (loop.M * loop.c - loop.D(x)) * 1.5 * loop.c * x)
        term = law.b**2 * law.p * x ** (2.0 * law.p - 1.0)
        return np.abs(loop.phi(x) + loop.D(x) * law.b * x**law.p + np.minimum(term, law.bound) - loop.M * term)

    x = reach * np.linspace(0.0, 1.0, 20001) ** 2
    within = np.maximum.accumulate(push(x)) < room
    X = 0.9 * float(x[within].max(initial=0.0))
    S = 0.5 * loop.c * X if law.name == "classical" else 0.0
    conditions = [_condition("reaching", room - float(push(X))), _condition("actuator", _room(document, law))]
    return _part("reaching", conditions, X=X, S=S)


def _start(scenario: Scenario, loop: Loop) -> tuple[float, float]:
    """Return x and s of a scenario's start."""
    x, v = scenario.resolved.x0[0], scenario.resolved.v0[0]
    return x, v + loop.c * x


def _levels(document: dict, loop: Loop, law: SimpleNamespace, found: search.Levels, scenario: Scenario) -> dict:
    """Return the levels of W as data."""
    x, v = scenario.resolved.x0[0], scenario.resolved.v0[0]
    top = _cell(found, *_start(scenario, loop))
    conditions = [_condition("actuator", _room(document, law)), _condition("start", found.outer - top)]
    data = {"x": found.x.tolist(), "s": found.s.tolist(), "W": found.W.tolist(), "start": [x, v]}
    data |= {"inner": found.inner, "outer": found.outer, "bound": found.bound} | (
        {"P": list(found.P)} if found.P else {}
    )
    return _part("level sets", conditions, **data)


def _cell(found: search.Levels, x: float, s: float) -> float:
    """Return the largest corner of the cell of a state, 1 outside of the grid."""
    x, s = (x, s) if x >= 0.0 else (-x, -s)
    if x >= found.x[-1] or abs(s) >= found.s[-1]:
        return 1.0
    i, j = (int(np.searchsorted(edges, at, side="right")) - 1 for edges, at in ((found.x, x), (found.s, s)))
    return float(found.W[i : i + 2, j : j + 2].max())


def _super_twisting(document: dict, loop: Loop, terms: list[float], law: SimpleNamespace) -> dict:
    """Return the largest set that Moreno & Osorio's quadratic form proves."""
    d0, slope, M, c = document["disturbance"], document["slope"], loop.M, loop.c
    if slope is None:
        raise ScenarioError(
            "super_twisting needs a bound of d': give one, as in smc.Uncertainty(disturbance=1.0, slope=2.0)"
        )
    A, B, C, E, F = terms
    u_max = math.inf if document["u_max"] is None else document["u_max"]
    w_max = math.inf if law.w_max is None else law.w_max
    best: tuple[float, dict] | None = None
    for L in law.k2 * np.linspace(0.05, 0.95, 19):
        P = _form(law.k1 / M, law.k2, L, M) if slope < L else None
        if P is None:
            continue
        Q = np.linalg.inv(P)

        def margins(q, Q=Q, L=L):
            z1, z2 = math.sqrt(q * Q[0, 0]), math.sqrt(q * Q[1, 1])
            X = z1 * z1 / c * (1.0 + 1e-9)
            v, x = z1 * z1 + c * X, np.linspace(-X, X, 101)
            D = np.array([E, E + F * X * X])[:, None]
            rate = np.abs(A * np.cos(x) + B + 3.0 * C * x * x - c * (M * c - D)).max()
            lean = np.abs(M * c - D).max()
            growth = rate * v + lean * (law.k1 * z1 + z2) / M + 2.0 * abs(F) * X * v * v + slope
            w = z2 + np.abs(loop.phi(x)).max() + lean * v + d0
            return X, L - growth, min(u_max - w - law.k1 * z1, w_max - w)

        low, high = 1e-12, 1e6
        if min(margins(low)[1:]) <= 0.0:
            continue
        for _ in range(80):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if min(margins(middle)[1:]) > 0.0 else (low, middle)
        X, _, _ = margins(low * ROUNDED)
        if best is None or best[0] < X:
            best = X, {"P": [P[0, 0], P[0, 1], P[1, 1]], "L": float(L), "q": low * ROUNDED, "X": X}
    if best is None:
        raise ScenarioError(
            f"found no quadratic form for super_twisting with k1 = {law.k1:g}, k2 = {law.k2:g}, |d| <= {d0:g} and "
            f"|d'| <= {slope:g}: give larger gains, or a smaller disturbance"
        )
    return _measured(document, best[1])


def _measured(document: dict, data: dict) -> dict:
    """Return the theorem of super-twisting with the margins that the checker derives, as it encloses them."""
    from smc_mujoco.evidence.certificates import checker

    names = ("integral", "slope", "actuator")
    derived = checker.super_twisting(
        document, data, checker.equation(document["plant"]), checker.feedback(document["law"], document["u_max"])
    )
    return _part("super-twisting", [_condition(name, float(derived[name])) for name in names], **data)


def _form(k1: float, k2: float, L: float, M: float) -> np.ndarray | None:
    """Return P > 0 with A' P + P A < 0 for A = [[-k1 / 2, 1 / 2M], [-k2 +- L, 0]], or None."""
    ends = [np.array([[-k1 / 2.0, 1.0 / (2.0 * M)], [end - k2, 0.0]]) for end in (-L, L)]

    def shape(z):
        return np.array([[math.exp(z[0]), z[1]], [z[1], 1.0]])

    def worst(z):
        P = shape(z)
        scale = np.diag(np.diag(P) ** -0.5)
        rates = [np.linalg.eigvalsh(scale @ (A.T @ P + P @ A) @ scale).max() for A in ends]
        return max(*rates, -np.linalg.eigvalsh(P).min())

    starts = [np.array([math.log(2.0 * k2 * M + 0.5 * (k1 * M) ** 2), -k1 * M / 2.0 * share]) for share in (0.3, 1.0)]
    found = min((minimize(worst, z, method="Nelder-Mead") for z in starts), key=lambda one: one.fun)
    return shape(found.x) if found.fun < 0.0 and np.linalg.det(shape(found.x)) > 0.0 else None
