"""Check a certificate in ball arithmetic, without trusting the code that made it: python checker.py
FILE.json

This file imports neither the maker of certificates nor the simulator. It has the equations of
plants and laws itself, derives each theorem's conditions from them, and encloses every number in a
ball (python-flint's arb). A plant obeys

    M x'' = A sin x + B x + C x^3 - (E + F x^2) x' + u + d + springs,    |d| <= d0

where springs of stiffness kc join the neighbours of a network. A law is u = -sigma(s), s = x' + c
x, where sigma(s) is lam tanh(s), K sat(a s / K) or k sgn(s), which the actuator clips at u_max. All
are odd: x >= 0 is all.
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
TEXTS = {"format", "name", "mechanism", "unit", "theorem", "seal"}  # what may have a text
ABSENT = {"u_max", "boxes"}  # what may be null: an infinite number
FIELDS = {
    "the certificate": "format plant law u_max unit disturbance parts seal",
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
    "lqr": "q1 q2 r a1 a2 b",
    "saturated PD": "theorem holds conditions V",
    "level sets": "theorem holds conditions x s W start P inner outer bound",
    "reaching": "theorem holds conditions X S",
}
MAY_LACK = {"P"}  # of level sets
MAX_HALVINGS = 6  # of a box in both directions


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
    if isinstance(value, dict):
        for name, item in value.items():
            finite(item, name)
    elif isinstance(value, list | tuple):
        for item in value:
            finite(item, where)
    elif isinstance(value, bool):
        need(where == "holds", where)
    elif isinstance(value, str):
        need(where in TEXTS, where)
    elif value is None:
        need(where in ABSENT, f"{where}, which is null")
    else:
        need(bool(math.isfinite(value) and abs(value) < 1e300), f"{where}, which is not finite")


def fields(doc):
    """Refuse fields that the format does not have, or that are missing, and a whole number that is
    none.
    """
    plant = doc["plant"]
    law = doc["law"]
    parts = [
        ("the certificate", doc),
        ("plant", plant),
        ("law", law),
        (plant["name"], plant["parameters"]),
        (law["name"], law["gains"]),
    ]
    for part in doc["parts"]:
        parts.append((part["theorem"], part))
        for condition in part["conditions"]:
            more = condition.keys() - {"name", "margin"}
            known = not more or condition["name"] == "restoring"
            need(known and more in (set(), {"boxes"}, {"at"}), "a condition")
    for name, given in parts:
        known = set(FIELDS[name].split())
        need(known - MAY_LACK <= given.keys() <= known, f"the fields of {name}")
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
    stated = {}
    for condition in part["conditions"]:
        stated[condition["name"]] = condition["margin"]
    same = len(stated) == len(part["conditions"]) and list(stated) == list(derived)
    need(same, f"the conditions of {part['theorem']}")
    kept = []
    for name, margin in derived.items():
        value, terms = margin or (arb(stated[name]), 0)
        equal(stated[name], value, f"the margin of {name}", terms)
        zero = bool(value == 0)
        kept.append(bool(value > 0) or (zero and name != "reaching"))
        need((stated[name] >= 0) is (kept[-1] or zero), f"the sign of {name}")
    need(part["holds"] is all(kept), "whether it holds")


def equation(plant):
    """Return the coefficients of a plant's equation."""
    p = Space(**{name: arb(value) for name, value in plant["parameters"].items()})
    name = plant["name"]
    n = plant["n"]
    if "network" in name:
        right = n >= 2
    else:
        right = n == 1 and plant["mechanism"] == "equation"
    need(right, f"{name} with {n} channels")
    zero = arb(0)
    e = Space(n=n, A=zero, B=zero, C=zero, F=zero, kc=getattr(p, "kc", zero))
    if name == "duffing":
        e.M, e.B, e.C, e.E = p.M, -p.alpha, -p.beta, p.delta
    elif name == "van_der_pol":
        e.M, e.B, e.E, e.F = p.M, -p.k, -p.mu, p.mu
    else:
        e.M, e.A, e.E = p.m * p.l * p.l, p.m * p.grav * p.l, p.b
        if name == "pendulum_network":  # which hangs
            e.A = -e.A
    return e


def feedback(law, u_max):
    """Return sigma: its kind, largest value K (None: unbounded), slope a at 0 (None: it switches),
    slope c of s; its `force` before the actuator; `room`, the force to spare and the size of the
    terms that it sums.
    """
    g = Space(**{key: arb(value) for key, value in law["gains"].items() if value is not None})
    name = law["name"]
    theorems = {"saturated PD", "level sets"}
    if name == "lqr":
        k1 = (g.a1 + (g.a1 * g.a1 + g.b * g.b * g.q1 / g.r).sqrt()) / g.b
        k2 = (g.a2 + (g.a2 * g.a2 + 2 * g.b * k1 + g.b * g.b * g.q2 / g.r).sqrt()) / g.b
        K = u_max and arb(u_max)  # the actuator's bound is part of a linear law
        room = arb(0), 0
        c = k1 / k2
        return Space(kind="sat", K=K, a=k2, c=c, force=k2, room=room, theorems=theorems)
    if name == "observer_free":
        f = Space(kind="tanh", K=g.lam, a=g.lam, c=g.k1, theorems=theorems)
        force = g.lam
    elif name == "boundary_layer":
        f = Space(kind="sat", K=g.k, a=g.k / g.phi, c=g.c, theorems=theorems)
        force = g.k
    else:
        need(name == "classical", f"law {name}")
        f = Space(kind="sgn", K=g.k, a=None, c=g.c, theorems=theorems | {"reaching"})
        force = g.k
    f.force = force
    f.room = arb(0), 0
    if u_max is not None:
        f.K = f.K.min(arb(u_max))  # what the actuator clips is part of the law
        f.room = (u_max - force).max(arb(0)), abs(force)
    return f


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
    state. Its term of sigma is force / c times the integral of sigma / force over c y.

    V' = -D v^2 - v (sigma(v + c x) - sigma(c x)), sigma never falls, and LaSalle's theorem leaves
    the origin alone if (1 - m) sigma(c x) >= phi(x) for x > 0, m > 0.
    """
    V = {
        "v^2": e.M / 2,
        "sigma": f.force / f.c,
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
        weakest = e.kc
        if doc["plant"]["mechanism"] != "equation":  # kc sin(z), whose sin(z) / z is at least this
            weakest = -abs(e.kc) * arb("0.2172336282112216")
        derived["coupling"] = weakest, 0
    if f.kind != "sgn":
        stiff = f.a * f.c
        derived["local"] = stiff - e.A - e.B, abs(stiff) + abs(e.A) + abs(e.B)
    return derived


def restoring(condition, e, f):
    """Check that (1 - m) sigma(c x) >= phi(x) for x > 0, by boxes without a gap.

    Or that it is false at a place, with the margin m < 0 there.
    """
    m = arb(condition["margin"])
    c = f.c
    if "at" in condition:
        need(condition["at"] > 0 and m < 0, "the place where the law is too weak")
        share = 1 - phi(e, arb(condition["at"])) / sigma(f, c * condition["at"])
        return equal(m, share, "the margin of restoring", 1)
    boxes = condition["boxes"]
    joined = all(box[1] == following[0] for box, following in pairwise(boxes))
    whole = joined and boxes[0][0] == 0 and boxes[-1][1] is None
    need(whole, "boxes from 0 to infinity, without a gap")
    for a, b in boxes[:-1]:
        x = hull(a, b)
        rate = (1 - m) * c * slope(f, c * x) - e.A * x.cos() - e.B - 3 * e.C * x * x
        least = rate
        if a != 0 or (f.kind == "sgn" and m != 1):
            mid = arb(a) / 2 + arb(b) / 2
            least = (1 - m) * sigma(f, c * mid) - phi(e, mid) + rate * (x - mid)
        need(bool(a < b) and least >= 0, f"x from {a} to {b}")
    last = arb(boxes[-1][0])  # beyond it x (B + C x^2) <= 0, and sigma has grown
    falling = e.C <= 0 and e.B + e.C * last**2 <= 0
    strong = 0 < m <= 1 and (1 - m) * sigma(f, c * last) >= abs(e.A)
    return need(falling and strong, f"x beyond {last}")


def levels(doc, part, e, f):
    """Check a bilinear W on a grid of (x, s): |d| <= d0 cannot keep W from falling between two of
    its levels.

    Then what starts where W <= outer ends where W <= inner, in |x| <= bound. It comes to rest if
    sigma is sgn and s = 0 is reached from that set, or if d0 = 0 and a form z' P z of z = (x, s)
    falls where it is at most 1, around that set.
    """
    d0 = arb(doc["disturbance"])
    xs = part["x"]
    ss = part["s"]
    W = part["W"]
    inner = part["inner"]
    outer = part["outer"]
    rising = all(a < b for edges in (xs, ss) for a, b in pairwise(edges))
    odd = [-s for s in reversed(ss)] == ss and W[0] == W[0][::-1]
    need(rising and xs[0] == 0 and odd, "a symmetric, rising grid")
    whole = len(W) == len(xs) and all(len(row) == len(ss) for row in W)
    need(whole and e.n == 1, "the size of the grid")
    border = min([*W[-1], *(row[0] for row in W), *(row[-1] for row in W)])
    shares = all(0 <= w <= 1 for row in W for w in row)
    need(f.room[0] >= 0 and 0 < inner < outer < border and shares, "the levels")
    inside = []
    middle = ss.index(0)
    for i, (x0, x1) in enumerate(pairwise(xs)):
        for j, (s0, s1) in enumerate(pairwise(ss)):
            corners = W[i][j], W[i + 1][j], W[i][j + 1], W[i + 1][j + 1]
            if min(corners) <= inner:
                inside += [(x0, s0), (x1, s0), (x0, s1), (x1, s1)]
            if max(corners) >= inner and min(corners) <= outer:
                fallen = falls(e, f, d0, (x0, x1, s0, s1), corners)
                need(fallen, f"W at x {x0} to {x1}, s {s0} to {s1}")
        a = W[i][middle]  # where s stays 0, x' = -c x
        b = W[i + 1][middle]
        slides = b > a or max(a, b) < inner or min(a, b) > outer
        need(f.kind != "sgn" or slides, f"sliding at x {x0} to {x1}")
    need(part["bound"] == max(x for x, _ in inside), "the bound")
    x, v = part["start"]
    side = 1 if x >= 0 else -1
    x = side * arb(x)
    s = side * v + f.c * x
    at = 1
    if x < xs[-1] and abs(s) < ss[-1]:
        i = sum(bool(x >= edge) for edge in xs) - 1
        j = sum(bool(s >= edge) for edge in ss) - 1
        at = max(*W[i][j : j + 2], *W[i + 1][j : j + 2])
    if f.kind == "sgn":
        (box,) = (other for other in doc["parts"] if other["theorem"] == "reaching")
        near = all(x <= box["X"] and abs(s) <= box["S"] for x, s in inside)
        need(near, "an inner set from which s = 0 is reached")
    elif d0 == 0:
        quadratic(part["P"], e, f, inside)
    return {"actuator": f.room, "start": (arb(outer) - at, 1)}


def falls(e, f, d0, box, corners, depth=MAX_HALVINGS):
    """Return whether W' < 0 in a box for every |d| <= d0.

    A box where that is not certain is cut into quarters.
    """
    x0, x1, s0, s1 = map(arb, box)
    w00, w10, w01, w11 = map(arb, corners)
    x = hull(x0, x1)
    s = hull(s0, s1)
    v = s - f.c * x
    D = e.E + e.F * x * x
    Wx = hull((w10 - w00) / (x1 - x0), (w11 - w01) / (x1 - x0))
    Ws = hull(w01 - w00, w11 - w10) / (s1 - s0)
    pushed = (Ws * (phi(e, x) - sigma(f, s)) + d0 * abs(Ws)) / e.M
    if (Wx + f.c * Ws - D * Ws / e.M) * v + pushed < 0:
        return True
    if not depth:
        return False
    x_ = (x0 + x1) / 2
    s_ = (s0 + s1) / 2
    low, high = (w00 + w10) / 2, (w01 + w11) / 2  # at s0 and s1
    left, right = (w00 + w01) / 2, (w10 + w11) / 2  # at x0 and x1
    mid = (low + high) / 2
    quarters = (
        ((x0, x_, s0, s_), (w00, low, left, mid)),
        ((x_, x1, s0, s_), (low, w10, mid, right)),
        ((x0, x_, s_, s1), (left, mid, w01, high)),
        ((x_, x1, s_, s1), (mid, right, high, w11)),
    )
    return all(falls(e, f, d0, *quarter, depth - 1) for quarter in quarters)


def quadratic(P, e, f, corners):
    """Check that z' P z, P = [[p, q], [q, r]], falls where it is at most 1, and that these corners
    lie in that set.
    """
    p, q, r = map(arb, P)
    det = p * r - q * q
    x = (r / det).sqrt()  # the largest |x| and |s| where the form is at most 1
    s = (p / det).sqrt()
    push = e.A * hull(x.sin() / x, 1) + e.B + e.C * hull(0, x * x)  # phi(x) / x for x < pi
    D = hull(e.E, e.E + e.F * x * x)
    gain = hull(sigma(f, s) / s, f.a)
    low = (push + D * f.c) / e.M - f.c * f.c  # x' = s - c x, s' = low x + high s
    high = f.c - (D + gain) / e.M
    a = 2 * (q * low - p * f.c)
    b = p + q * (high - f.c) + r * low
    d = 2 * (q + r * high)
    positive = p > 0 and det > 0 and x < 3
    need(positive and a < 0 and a * d - b * b > 0, "a positive form that falls")
    around = all(p * x * x + 2 * q * x * s + r * s * s <= 1 for x, s in corners)
    need(around, "a form around the inner set")


def reaching(doc, part, e, f):
    """Check that k > |phi + (M c - D) v| + d0 for |x| <= X and |s| <= S <= c X, so that s = 0 is
    reached and kept.

    Then x' = -c x.
    """
    d0 = arb(doc["disturbance"])
    X = arb(part["X"])
    S = arb(part["S"])
    need(e.n == 1 and X >= 0 and S >= 0 and f.c * X >= S, "|s| <= c X")

    def push(a, b, s):
        x = hull(a, b)
        D = e.E + e.F * x**2
        return abs(phi(e, x) + (e.M * f.c - D) * (s - f.c * x)) + d0

    edges = [X * i / 64 for i in range(65)]
    strips = [hull(S * j / 8, S * (j + 1) / 8) for j in range(-8, 8)]
    least = min((f.K - push(a, b, s)).lower() for a, b in pairwise(edges) for s in strips)
    need(bool(X > 0) is bool(least > 0), "reaching")
    return {"reaching": (least, f.force), "actuator": f.room}


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
}


def check(doc):
    """Check a certificate, the dict of its JSON.

    Raise Refused with the first statement that is not proven.
    """
    try:
        finite(doc)
        need(doc["format"] == FORMAT and doc["seal"] == seal(doc), "the seal")
        fields(doc)
        e = equation(doc["plant"])
        f = feedback(doc["law"], doc["u_max"])
        strong = (f.K is None or f.K > 0) and (f.a is None or f.a > 0)
        if "pendulum" in doc["plant"]["name"]:
            unit = "rad"
        else:
            unit = "m"
        sound = e.M > 0 and f.c > 0 and strong and doc["disturbance"] >= 0
        need(sound and doc["unit"] == unit, "plant, law, bounds and unit")
        theorems = [part["theorem"] for part in doc["parts"]]
        known = 0 < len(theorems) == len(set(theorems)) and set(theorems) <= f.theorems
        need(known, "a theorem of this law")
        for part in doc["parts"]:
            margins(part, THEOREMS[part["theorem"]](doc, part, e, f))
    except Refused:
        raise
    except Exception as error:
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
