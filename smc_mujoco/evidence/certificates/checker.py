"""Check a certificate in ball arithmetic, without trusting the code that made it: python checker.py
FILE.json

This file imports neither the maker of certificates nor the simulator. It has the equations of
plants and laws itself, derives each theorem's conditions from them, and encloses every number in a
ball (python-flint's arb). A plant obeys

    M x'' = A sin x + B x + C x^3 - (E + F x^2) x' + u + d + springs,    |d| <= d0,    |d'| <= slope

where springs of stiffness kc join the neighbours of a network. A law is u = -sigma(s), s = x' + c
x, where sigma(s) is lam tanh(s), K sat(a s / K) or k sgn(s), which the actuator clips at u_max, or
one of the laws "terminal" and "super_twisting". All are odd: x >= 0 is all.
"""

import hashlib
import json
import math
import sys
from itertools import pairwise
from types import SimpleNamespace as Space

try:
    from flint import arb
except ImportError:
    sys.exit("the checker needs python-flint: pip install python-flint")

FORMAT = "smc-certificate/1"
LEAVES_OUT = [
    "sampling",
    "delay",
    "noise",
    "dry friction",
    "contact",
    "drive",
    "other parameters",
    "rounding",
]
TEXTS = {"format", "name", "mechanism", "unit", "theorem", "seal"}  # what may have a text
ABSENT = {"u_max", "slope", "w_max", "boxes"}  # what may be null: an infinite number
FIELDS = {
    "the certificate": "format plant law u_max unit disturbance slope leaves_out parts seal",
    "plant": "name n parameters mechanism",
    "law": "name gains",
    "inverted_pendulum": "m l b grav",
    "pendulum_network": "m l b grav kc",
    "inverted_pendulum_network": "m l b grav kc",
    "duffing": "M delta alpha beta",
    "van_der_pol": "M mu k",
    "observer_free": "lam k1",
    "boundary_layer": "k c phi",
    "classical": "k c",
    "terminal": "k b p bound",
    "super_twisting": "k1 k2 c w_max",
    "lqr": "q1 q2 r a1 a2 b",
    "pid": "kp ki kd tau tt",
    "saturated PD": "theorem holds conditions V",
    "level sets": "theorem holds conditions x s W start P inner outer bound",
    "reaching": "theorem holds conditions X S",
    "super-twisting": "theorem holds conditions P L q X",
}
MAY_LACK = {"P"}  # of level sets
MARGIN_TOLERANCE, MAX_HALVINGS = (
    3e-4,
    6,
)  # share below the true margin; halvings of a box in both directions


class Refused(Exception):
    """A statement of the certificate that is not proven."""


def need(holds, statement):
    """Raise Refused unless a statement is certainly true."""
    if holds is not True:
        raise Refused(statement)


def hull(a, b):
    """Return the ball around two numbers."""
    return arb(a).union(arb(b))


def finite(value, where="the certificate"):
    """Refuse a certificate with other than finite numbers, and texts and truth values in their
    places.
    """
    if isinstance(value, dict | list | tuple):
        for name, item in value.items() if isinstance(value, dict) else enumerate(value):
            finite(item, str(name) if isinstance(value, dict) else where)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        need(
            bool(math.isfinite(value) and abs(value) < 1e300),
            f"{where}, which is not a finite number",
        )
    elif value is None:
        need(where in ABSENT, f"{where}, which is null")
    else:
        need(
            where in TEXTS
            if isinstance(value, str)
            else where == "holds" and isinstance(value, bool),
            f"{where!a}",
        )


def fields(doc):
    """Refuse fields that the format does not have, or that are missing, and a whole number that is
    none.
    """
    plant = doc["plant"]
    law = doc["law"]
    parts = doc["parts"]
    told = [
        ("the certificate", doc),
        ("plant", plant),
        ("law", law),
        *((part["theorem"], part) for part in parts),
    ]
    for name, its in [*told, (plant["name"], plant["parameters"]), (law["name"], law["gains"])]:
        known = set(FIELDS[name].split())
        need(known - MAY_LACK <= its.keys() <= known, f"the fields of {name}")
    for condition in (condition for part in parts for condition in part["conditions"]):
        more = condition.keys() - {"name", "margin"}
        need(
            more in (set(), {"boxes"}, {"at"}) and (not more or condition["name"] == "restoring"),
            "a condition",
        )
    need(type(plant["n"]) is int, "the number of channels")


def equal(stated, derived, what, terms=0):
    """Refuse a number that differs from the derived one by more than 1e-9 of it, or of the terms
    that it sums.
    """
    need(abs(arb(stated) - derived) <= abs(derived).max(arb(terms)) * 1e-9, f"{what} is {stated}")


def margins(part, derived):
    """Refuse conditions other than these, with other margins (None: checked elsewhere), or a wrong
    `holds`.

    A margin is derived as (its value, the size of the terms that it sums). Its sign is that of the
    value derived, or of the one told where it was checked elsewhere.
    """
    told = {condition["name"]: condition["margin"] for condition in part["conditions"]}
    need(
        len(told) == len(part["conditions"]) and list(told) == list(derived),
        f"the conditions of {part['theorem']}",
    )
    kept = []
    for name, margin in derived.items():
        if margin is None:
            value = arb(told[name])
            terms = 0
        else:
            value, terms = margin
        equal(told[name], value, f"the margin of {name}", terms)
        kept.append(bool(value > 0) or (bool(value == 0) and name != "reaching"))
        need((told[name] >= 0) is (kept[-1] or bool(value == 0)), f"the sign of {name}")
    need(part["holds"] is all(kept), "whether it holds")


def words(told):
    """Refuse what is left out but fixed names, with words and their numbers below, {word: {name:
    number}}.
    """
    need(sorted(told) == sorted(LEAVES_OUT), "what is left out")
    for what in told.values():
        for word, numbers in what.items():
            need(word.isidentifier() and word.isascii() and len(word) <= 40, f"the word {word!a}")
            known = all(
                n.isidentifier() and n.isascii() and type(v) in (int, float)
                for n, v in numbers.items()
            )
            need(known and len(numbers) <= 40, f"the numbers of {word}")
    (sampling,), (step,) = (
        told["sampling"].values(),
        (numbers["step"] for numbers in told["rounding"].values()),
    )
    need(sampling["period"] > 0 and step > 0, "a period and a step above 0")


def equation(plant):
    """Return the coefficients of a plant's equation."""
    p = Space(**{name: arb(value) for name, value in plant["parameters"].items()})
    n = plant["n"]
    zero = arb(0)
    name = plant["name"]
    network = "network" in plant["name"]
    need(
        n >= 2 if network else n == 1 and plant["mechanism"] == "equation",
        f"{name} with {n} channels",
    )
    if name in ("inverted_pendulum", "pendulum_network", "inverted_pendulum_network"):
        A = p.m * p.grav * p.l * (-1 if name == "pendulum_network" else 1)
        return Space(
            M=p.m * p.l * p.l, A=A, B=zero, C=zero, E=p.b, F=zero, kc=p.kc if network else zero, n=n
        )
    if name == "duffing":
        return Space(M=p.M, A=zero, B=-p.alpha, C=-p.beta, E=p.delta, F=zero, kc=zero, n=n)
    need(name == "van_der_pol", f"plant {name}")
    return Space(M=p.M, A=zero, B=-p.k, C=zero, E=-p.mu, F=p.mu, kc=zero, n=n)


def feedback(law, u_max):
    """Return sigma: its kind, largest value K (None: unbounded), slope a at 0, slope c of s; gains;
    force to spare.
    """
    g = Space(**{key: arb(value) for key, value in law["gains"].items() if value is not None})
    name = law["name"]
    room = lambda top: (arb(0), 0) if u_max is None else (u_max - top, abs(top))  # noqa: E731
    top = lambda force: force if u_max is None else force.min(arb(u_max))  # the actuator clips  # noqa: E731
    spare = lambda force: (room(force)[0].max(arb(0)), room(force)[1])  # noqa: E731
    if name == "observer_free":
        return Space(
            kind="tanh", K=top(g.lam), a=g.lam, c=g.k1, g=g, room=spare(g.lam), theorems=(0, 2)
        )
    if name == "boundary_layer":
        return Space(
            kind="sat", K=top(g.k), a=g.k / g.phi, c=g.c, g=g, room=spare(g.k), theorems=(0, 2)
        )
    if name == "classical":
        return Space(kind="sgn", K=top(g.k), a=None, c=g.c, g=g, room=spare(g.k), theorems=(0, 3))
    if name == "terminal":
        need(g.b > 0 and g.bound >= 0 and bool(0.5 < g.p < 1), "1/2 < p < 1 on v + b [x]^p")
        return Space(
            kind="sgn", K=g.k, a=None, c=arb(1), g=g, room=room(g.k + g.bound), theorems=(1, 3)
        )
    if name == "super_twisting":
        return Space(kind=None, c=g.c, g=g, theorems=(3, 4))
    if name == "lqr":
        k1 = (g.a1 + (g.a1 * g.a1 + g.b * g.b * g.q1 / g.r).sqrt()) / g.b
        k2 = (g.a2 + (g.a2 * g.a2 + 2 * g.b * k1 + g.b * g.b * g.q2 / g.r).sqrt()) / g.b
    else:
        need(name == "pid" and g.ki == 0, f"law {name}")
        k1 = g.kp
        k2 = g.kd
    K = u_max and arb(u_max)  # the actuator's bound is part of a linear law
    return Space(kind="sat", K=K, a=k2, c=k1 / k2, g=g, room=(arb(0), 0), theorems=(0, 2))


def phi(e, x):
    """Return the force A sin x + B x + C x^3."""
    return e.A * x.sin() + x * (e.B + e.C * x * x)


def sigma(f, s):
    """Return sigma over a ball.

    For sgn, s has one sign; where it ends at 0, sigma is the limit there.
    """
    if f.kind == "tanh":
        return (f.a * s.tanh()).min(f.K).max(-f.K)
    if f.kind == "sat":
        if f.K is None:
            return f.a * s
        return (f.a * s).min(f.K).max(-f.K)
    return f.K if s.mid() > 0 else -f.K


def slope(f, s):
    """Return sigma' over a ball, away from 0 for sgn."""
    if f.kind == "tanh":
        rate = f.a / (s.cosh() * s.cosh())
        force = f.a * abs(s).tanh()
        if force > f.K:
            return arb(0)
        if f.a <= f.K or force < f.K:
            return rate
        return hull(0, rate.upper()).union(rate)
    if f.kind == "sgn" or (f.K is not None and f.a * abs(s) > f.K):
        return arb(0)
    if f.K is None or f.a * abs(s) < f.K:
        return f.a
    return hull(0, f.a)


def saturated(doc, part, e, f):
    """Check:

    V = M v^2/2 + int_0^x (sigma(c y) - phi(y)) dy + springs has V' <= 0, so that 0 attracts every
    state.

    V' = -D v^2 - v (sigma(v + c x) - sigma(c x)), sigma never falls, and LaSalle's theorem leaves
    the origin alone if (1 - m) sigma(c x) >= phi(x) for x > 0, m > 0. On s = v + b [x]^p the same
    holds with sgn(x) for sigma(c x).
    """
    if doc["plant"]["mechanism"] == "equation":
        weakest = e.kc
    else:
        weakest = -abs(e.kc) * arb("0.2172336282112216")
    V = {
        "v^2": e.M / 2,
        "sigma": 1 / f.c,
        "cos x - 1": e.A,
        "x^2": -e.B / 2,
        "x^4": -e.C / 4,
        "springs": e.kc / 2,
    }
    need(part["V"].keys() == V.keys(), "the terms of V")
    for name, value in V.items():
        equal(part["V"][name], value, f"the coefficient of {name} in V")
    restoring(part["conditions"][1], e, f)
    derived = {
        "damping": (-abs(e.F) if e.F != 0 else e.E, 0),
        "restoring": None,
        "actuator": f.room,
    }
    if e.n > 1:
        derived |= {"coupling": (weakest, 0)}
    else:
        derived |= {}
    local = f.kind != "sgn" and {
        "local": (f.a * f.c - e.A - e.B, abs(f.a * f.c) + abs(e.A) + abs(e.B))
    }
    return derived | local if local else derived


def restoring(told, e, f):
    """Check that (1 - m) sigma(c x) >= phi(x) for x > 0, by boxes without a gap, and that m <= 1 is
    tight.
    """
    m = arb(told["margin"])
    c = f.c
    smooth = f.kind != "sgn"
    if "at" in told:
        need(told["at"] > 0 and m < 0, "the place where the law is too weak")
        return equal(
            m, 1 - phi(e, arb(told["at"])) / sigma(f, c * told["at"]), "the margin of restoring", 1
        )
    boxes = told["boxes"]
    best = (1 - (e.A + e.B) / (f.a * c)).min(arb(1)) if smooth else arb(1)
    joined = all(box[1] == following[0] for box, following in pairwise(boxes))
    need(
        joined and boxes[0][0] == 0 and boxes[-1][1] is None,
        "boxes from 0 to infinity, without a gap",
    )
    for a, b in boxes[:-1]:
        x = hull(a, b)
        mid = arb(a) / 2 + arb(b) / 2
        rate = (1 - m) * c * slope(f, c * x) - e.A * x.cos() - e.B - 3 * e.C * x * x
        if a == 0 and (smooth or m == 1):
            q = rate
        else:
            q = (1 - m) * sigma(f, c * mid) - phi(e, mid) + rate * (x - mid)
        need(bool(a < b) and q >= 0, f"x from {a} to {b}")
        best = best.min(1 - phi(e, arb(b)) / sigma(f, c * b))
    last = arb(boxes[-1][0])  # beyond it x (B + C x^2) <= 0, and sigma has grown
    falls = (
        e.C <= 0
        and e.B + e.C * last**2 <= 0
        and 0 < m <= 1
        and (1 - m) * sigma(f, c * last) >= abs(e.A)
    )
    need(falls, f"x beyond {last}")
    return need(best - m <= MARGIN_TOLERANCE * abs(m).max(arb(0.1)), "a tight margin")


def levels(doc, part, e, f):
    """Check a bilinear W on a grid of (x, s): |d| <= d0 cannot keep W from falling between two of
    its levels.

    Then what starts where W <= outer ends where W <= inner, in |x| <= bound. It comes to rest if
    sigma is sgn and s = 0 is reached from that set, or if d0 = 0 and a form z' P z of z = (x, s)
    falls where it is at most 1, around that set.
    """
    d0, xs, ss, W, inner, outer = (
        arb(doc["disturbance"]),
        *(part[key] for key in ("x", "s", "W", "inner", "outer")),
    )
    middle = ss.index(0)
    border = min([*W[-1], *(row[0] for row in W), *(row[-1] for row in W)])
    rising = all(a < b for edges in (xs, ss) for a, b in pairwise(edges))
    need(
        rising and xs[0] == 0 and [-s for s in reversed(ss)] == ss and W[0] == W[0][::-1],
        "a symmetric, rising grid",
    )
    need(
        len(W) == len(xs) and all(len(row) == len(ss) for row in W) and e.n == 1,
        "the size of the grid",
    )
    need(
        f.room[0] >= 0
        and 0 < inner < outer < border
        and all(0 <= w <= 1 for row in W for w in row),
        "the levels",
    )
    inside, (x, v) = [], part["start"]
    for i, (x0, x1) in enumerate(pairwise(xs)):
        for j, (s0, s1) in enumerate(pairwise(ss)):
            corners = W[i][j], W[i + 1][j], W[i][j + 1], W[i + 1][j + 1]
            if min(corners) <= inner:
                inside += [(x0, s0), (x1, s0), (x0, s1), (x1, s1)]
            else:
                inside += []
            if max(corners) >= inner and min(corners) <= outer:
                need(
                    falls(e, f, d0, (x0, x1, s0, s1), corners),
                    f"W at x {x0} to {x1}, s {s0} to {s1}",
                )
        a, b = W[i][middle], W[i + 1][middle]  # where s stays 0, x' = -c x
        need(
            f.kind != "sgn" or b > a or max(a, b) < inner or min(a, b) > outer,
            f"sliding at x {x0} to {x1}",
        )
    need(part["bound"] == max(x for x, _ in inside), "the bound")
    x, s = (1 if x >= 0 else -1) * arb(x), (1 if x >= 0 else -1) * (v + f.c * x)
    i, j = (sum(bool(z >= edge) for edge in edges) - 1 for z, edges in ((x, xs), (s, ss)))
    if x < xs[-1] and abs(s) < ss[-1]:
        at = max(*W[i][j : j + 2], *W[i + 1][j : j + 2])
    else:
        at = 1
    if f.kind == "sgn":
        (box,) = (other for other in doc["parts"] if other["theorem"] == "reaching")
        need(
            all(x <= box["X"] and abs(s) <= box["S"] for x, s in inside),
            "an inner set from which s = 0 is reached",
        )
    elif d0 == 0:
        quadratic(part["P"], e, f, inside)
    return {"actuator": f.room, "start": (arb(outer) - at, 1)}


def falls(e, f, d0, box, corners, depth=MAX_HALVINGS):
    """Return whether W' < 0 in a box for every |d| <= d0.

    A box where that is not certain is cut into quarters.
    """
    (x0, x1, s0, s1), (w00, w10, w01, w11) = map(arb, box), map(arb, corners)
    x = hull(x0, x1)
    s = hull(s0, s1)
    edge = x1 - x0
    v = s - f.c * x
    D = e.E + e.F * x * x
    Wx = hull((w10 - w00) / edge, (w11 - w01) / edge)
    Ws = hull(w01 - w00, w11 - w10) / (s1 - s0)
    if (Wx + f.c * Ws - D * Ws / e.M) * v + (
        Ws * (phi(e, x) - sigma(f, s)) + d0 * abs(Ws)
    ) / e.M < 0:
        return True
    w = [[w00, (w00 + w01) / 2, w01], [], [w10, (w10 + w11) / 2, w11]]
    w[1] = [(a + b) / 2 for a, b in zip(w[0], w[2], strict=True)]
    X = (x0, (x0 + x1) / 2, x1)
    S = (s0, (s0 + s1) / 2, s1)
    quarters = ((0, 0), (0, 1), (1, 0), (1, 1))
    parts = (
        ((*X[i : i + 2], *S[j : j + 2]), (*w[i][j : j + 2], *w[i + 1][j : j + 2]))
        for i, j in quarters
    )
    return depth > 0 and all(
        falls(e, f, d0, quarter, (a, c, b, d), depth - 1) for quarter, (a, b, c, d) in parts
    )


def quadratic(P, e, f, corners):
    """Check that z' P z, P = [[p, q], [q, r]], falls where it is at most 1, and that these corners
    lie in that set.
    """
    p, q, r = map(arb, P)
    det = p * r - q * q
    x, s = (r / det).sqrt(), (p / det).sqrt()  # the largest |x| and |s| where the form is at most 1
    push = e.A * hull(x.sin() / x, 1) + e.B + e.C * hull(0, x * x)  # phi(x) / x for x < pi
    D = hull(e.E, e.E + e.F * x * x)
    gain = hull(sigma(f, s) / s, f.a)
    low, high = (
        (push + D * f.c) / e.M - f.c * f.c,
        f.c - (D + gain) / e.M,
    )  # x' = s - c x, s' = low x + high s
    a = 2 * (q * low - p * f.c)
    b = p + q * (high - f.c) + r * low
    d = 2 * (q + r * high)
    need(p > 0 and det > 0 and x < 3 and a < 0 and a * d - b * b > 0, "a positive form that falls")
    need(
        all(p * x * x + 2 * q * x * s + r * s * s <= 1 for x, s in corners),
        "a form around the inner set",
    )


def reaching(doc, part, e, f):
    """Check that k > |phi + (M c - D) v| + d0 for |x| <= X and |s| <= S <= c X, so that s = 0 is
    reached and kept.

    Then x' = -c x. On a terminal surface the same is checked at s = 0, where x = 0 after X^(1 - p)
    / (b (1 - p)).
    """
    g, terminal, (d0, X, S) = (
        f.g,
        "b" in vars(f.g),
        map(arb, (doc["disturbance"], part["X"], part["S"])),
    )
    need(
        e.n == 1 and X >= 0 and (S == 0 if terminal else bool(S >= 0 and f.c * X >= S)),
        "|s| <= c X",
    )

    def push(a, b, s):
        x = hull(a, b)
        D = e.E + e.F * hull(a, b) ** 2
        if not terminal:
            return abs(phi(e, x) + (e.M * f.c - D) * (s - f.c * x)) + d0
        v, vs = (g.b * hull(a**power if a > 0 else 0, b**power) for power in (g.p, 2 * g.p - 1))
        return abs(phi(e, x) + D * v + (g.b * g.p * vs).min(g.bound) - e.M * g.b * g.p * vs) + d0

    edges = [X * i / 64 for i in range(65)]
    strips = [hull(S * j / 8, S * (j + 1) / 8) for j in range(-8, 8)]
    least = min((f.K - push(a, b, s)).lower() for a, b in pairwise(edges) for s in strips)
    need(bool(X > 0) is bool(least > 0), "reaching")
    return {"reaching": (least, g.k), "actuator": f.room}


def super_twisting(doc, part, e, f):
    """Check Moreno & Osorio's form: z' P z with z = ([s]^(1/2), w + delta) falls where z' P z <= q
    and |x| <= X.

    M s' = -k1 z1 + z2, z2' = -k2 sgn(s) + delta', delta = phi + (M c - D) v + d, and |delta'| <= L
    there. The form falls if A' P + P A < 0 at both ends of L, A = [[-k1 / 2M, 1 / 2M], [-k2 +- L,
    0]].
    """
    g, (p, q, r), (L, size, X) = (
        f.g,
        map(arb, part["P"]),
        (arb(part[key]) for key in ("L", "q", "X")),
    )
    det = p * r - q * q
    for end in (L, -L):
        a = -g.k1 / (2 * e.M)
        b = 1 / (2 * e.M)
        low = end - g.k2
        n11 = 2 * (a * p + low * q)
        n12 = b * p + a * q + low * r
        n22 = 2 * b * q
        need(n11 < 0 and n11 * n22 - n12 * n12 > 0, f"a falling form at L = {end}")
    z1 = (size * r / det).sqrt()
    z2 = (size * p / det).sqrt()
    need(
        z1 * z1 <= g.c * X and p > 0 and det > 0 and size > 0 and L > 0 and e.n == 1,
        "a positive form, |s| <= c X",
    )
    v = z1 * z1 + g.c * X
    x = hull(-X, X)
    D = hull(e.E, e.E + e.F * X * X)
    rate = e.A * x.cos() + e.B + 3 * e.C * x * x - g.c * (e.M * g.c - D)
    fast = abs(e.M * g.c - D) * (g.k1 * z1 + z2) / e.M + 2 * abs(e.F) * X * v * v
    w = z2 + abs(phi(e, x)) + abs(e.M * g.c - D) * v + doc["disturbance"]
    if doc["u_max"] is None:
        top = arb(0)
    else:
        top = (doc["u_max"] - w - g.k1 * z1).lower()
    if "w_max" in vars(g):
        top = top.min((g.w_max - w).lower())
    slack = (L - abs(rate) * v - fast - doc["slope"]).lower()
    size = abs(g.k2) + doc["slope"]
    return {
        "integral": (g.k2 - doc["slope"], size),
        "slope": (slack, L),
        "actuator": (top, w + g.k1 * z1),
    }


def seal(doc):
    """Return the hash of a certificate without its seal."""
    text = json.dumps({key: value for key, value in doc.items() if key != "seal"}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def once(pairs):
    """Return the dict of a JSON object. Refuse one that names a field twice."""
    need(len(dict(pairs)) == len(pairs), "which of two fields of one name counts")
    return dict(pairs)


THEOREMS = {
    "level sets": levels,
    "saturated PD": saturated,
    "reaching": reaching,
    "super-twisting": super_twisting,
}


def check(doc):
    """Check a certificate, the dict of its JSON.

    Raise Refused with the first statement that is not proven.
    """
    try:
        finite(doc)
        need(doc["format"] == FORMAT and doc["seal"] == seal(doc), "the seal")
        fields(doc)
        words(doc["leaves_out"])
        e = equation(doc["plant"])
        f = feedback(doc["law"], doc["u_max"])
        strong = f.kind is None or ((f.K is None or f.K > 0) and (f.a is None or f.a > 0))
        unit = "rad" if "pendulum" in doc["plant"]["name"] else "m"
        least = min(doc["disturbance"], doc["slope"] or 0)
        need(
            e.M > 0 and f.c > 0 and strong and least >= 0 and doc["unit"] == unit,
            "plant, law, bounds and unit",
        )
        theorems = [part["theorem"] for part in doc["parts"]]
        known = list(THEOREMS)[slice(*f.theorems)]
        need(
            0 < len(theorems) == len(set(theorems)) and set(theorems) <= set(known),
            "a theorem of this law",
        )
        for part in doc["parts"]:
            margins(part, THEOREMS[part["theorem"]](doc, part, e, f))
    except (
        KeyError,
        TypeError,
        ValueError,
        IndexError,
        AttributeError,
        ArithmeticError,
        RecursionError,
    ) as error:
        raise Refused(f"its form, {error!r}") from None


def main(paths):
    """Check files. End with exit code 1 at the first that is refused."""
    for path in paths:
        try:
            with open(path, encoding="utf-8") as file:
                check(json.load(file, object_pairs_hook=once))
            print(f"{path} is accepted: every statement is proven")
        except Refused as why:
            sys.exit(f"{path} is refused: not proven is {why}")
        except (OSError, ValueError, RecursionError) as error:
            sys.exit(f"{path} is refused: it is no JSON file, {error}")


if __name__ == "__main__":
    main(sys.argv[1:])
