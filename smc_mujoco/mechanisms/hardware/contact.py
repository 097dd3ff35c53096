"""Contact: obstacles that a mechanism hits, falls on or slides over, with friction and restitution.

A plant offers kinds of contact; each is an edit of its MjSpec that brings obstacles and explicit
contact pairs, made with the helpers below. Two sorts of pair:

- `hit:...`: a blow along the normal. MuJoCo's contact with constant impedance is a spring and
  dashpot that only push: r'' = -2 zeta w r' - w^2 r, with r the depth, as long as this pushes. The
  bodies part when the force is zero, with the share e = exp(-2 a cot a) of the speed before, where
  cos a = zeta (for zeta > 1: cosh): T. Schwager and T. Poeschel, Coefficient of restitution and
  linear-dashpot model revisited, Granular Matter 9, 2007. The depth is sqrt(e)/w per m/s. The
  wanted e gives zeta; w is chosen for a depth of 5 mm per m/s, 1.5 mm between bobs, at any e.
- `rub:...`: sliding under a normal force with Coulomb friction and the elliptic cone. Friction that
  holds by the acceleration b v at a speed v also pushes a sliding block off the surface, by mu b v.
  Above g (1 - d) / d the block hops. So the normal is soft (impedance d = 0.01), and impratio makes
  friction stiff: it is mu m g within 1 % up to mu v = 0.4 m/s, and within 4 % up to 1 m/s. A stuck
  block creeps at 2.5e-7 s times the acceleration that friction holds back. Below the speed mu g /
  b, 5 mm/s for mu = 0.1, friction is viscous.

MuJoCo's contact spring sets an acceleration: its stiffness is proportional to the mass that the
blow meets. If this mass changes during the blow, as between two swinging bobs that graze each
other, such a spring would create energy. With a low impedance it sets a force instead.
"""

import functools
import math
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from typing import Annotated, ClassVar

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Pair
from smc_mujoco.common.constraints import Number
from smc_mujoco.common.data import frozen_data
from smc_mujoco.common.errors import ScenarioError, shown, unknown
from smc_mujoco.mechanisms.hardware.part import Part
from smc_mujoco.mechanisms.plant import Field, Plant

Ends = tuple[Sequence[float], Sequence[float]]  # of a bar
HIT = "hit:"
RUB = "rub:"
# m per m/s of a blow: chosen, so that 2 m/s goes 1 cm deep; e is met within 4 % at h = 0.25 ms
DEPTH = 0.005
# m per m/s: chosen, so that no rod of a falling chain passes through a bob. With h = 0.25 ms such a
# short blow meets e within 5 % if e >= 0.5; it is up to 9 % too low at e = 0.2, and up to 12 % at
# 0.1.
DEPTH_OF_BOBS = 0.0015
# largest restitution: above, a blow could gain energy, by the integrator's error of 1e-3 of it
MAX_RESTITUTION = 0.98
MIN_RESTITUTION = 0.01  # used for smaller ones, whose dashpot is too stiff for a step of 1 ms
MAX_FRICTION = 10.0  # chosen; rubber on rubber reaches 2
# Constant impedances d: firm for blows on a fixed obstacle, soft for blows between bobs and for
# sliding. The spring carries 1 - d of a steady load. At 0.95 a body that leans on an obstacle rests
# within 0.1 mm; at 0.99 it rattles.
FIRM_IMPEDANCE = 0.95
SOFT_IMPEDANCE = 0.01
REST_OF_SOLIMP = (0.001, 0.5, 2.0)  # no effect if d is constant
# s and damping ratio of the normal: 8 steps of 1 ms; with fewer the block trembles
SOLREF_RUB = (0.008, 1.0)
# 1/s, b: chosen; half doubles the creep of the block, twice varies friction 4 times as much
STICKING_RATE = 200.0
# s and damping ratio across the normal
SOLREF_SLIDE = (2.0 / (SOFT_IMPEDANCE * STICKING_RATE), 1.0)
IMPRATIO = 5e3 / SOFT_IMPEDANCE  # how much stiffer friction is than the normal
# MuJoCo's torsional and rolling friction: unused by contacts of dimension 3
TURNING_FRICTION = (0.005, 0.0001, 0.0001)
SLIDING_FRICTION = slice(0, 2)  # of a pair's five friction coefficients


@frozen_data
class Obstacle(Part):
    """Base of what a mechanism may touch."""

    loose: ClassVar[bool] = False  # whether it moves by itself
    solid: ClassVar[bool] = True  # whether geoms meet it
    longest_step: ClassVar[float] = math.inf  # s, of the default physics steps that resolve it

    def check(self, plant: Plant) -> None:
        """Raise ScenarioError if the plant cannot have it."""

    def edit_on(self, plant: Plant, spec: mujoco.MjSpec) -> None:
        """Add it to the plant's mechanism."""

    def placed(self, plant: Plant) -> Hashable:
        """Return a key that is equal where `edit_on` does the same."""
        return self, plant

    def meets(self, plant: Plant, x: Iterable[float]) -> str:
        """Return in words what meets it with the channels at x, (n,) rad or m; "" for nothing."""
        del plant, x
        return ""


@frozen_data
class Contact(Obstacle):
    """One of the contacts that a plant offers.

    Attributes:
      kind: its name, or "none".
      friction: coefficient of Coulomb friction where bodies slide, 0 .. 10. None: the plant's own.
      restitution: ratio of the speeds after and before a blow, 0 .. 0.98; values below 0.01 count
        as 0.01. None: the plant's own.
    """

    kind: str
    friction: Annotated[float, Number(low=0.0, high=MAX_FRICTION)] | None = None
    restitution: Annotated[float, Number(low=0.0, high=MAX_RESTITUTION)] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.kind, str):
            raise ScenarioError(
                f"contact is {shown(self.kind)}: give the name of a kind, such as 'floor'"
            )

    def __str__(self) -> str:
        return repr(self.kind)

    def check(self, plant: Plant) -> None:
        """Check that the plant offers this contact."""
        if self.kind != "none" and self.kind not in plant.contacts:
            raise unknown(f"contact of {plant.name}", self.kind, ["none", *plant.contacts])
        for name in ("friction", "restitution"):
            if getattr(self, name) is None:
                continue
            if self.kind == "none" or name not in _takes(
                plant.build, plant.sizes[0], plant.contacts[self.kind]
            ):
                raise ScenarioError(
                    f"contact {self.kind!r} of {plant.name} has no {name}: leave it out"
                )

    def edit_on(self, plant: Plant, spec: mujoco.MjSpec) -> None:
        """Add to the plant's mechanism the obstacles and contact pairs of this kind."""
        if self.kind != "none":
            plant.contacts[self.kind](spec)

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        if self.friction is not None:
            yield Field("pair_friction", (_pairs(model, RUB), SLIDING_FRICTION), self.friction)
        if self.restitution is not None:
            bouncing = _pairs(model, HIT)
            impedances = model.pair_solimp[bouncing, 0]
            yield Field("pair_solref", bouncing, [solref(self.restitution, d) for d in impedances])

    def placed(self, plant: Plant) -> Hashable:
        return plant.contacts[self.kind]


def kinds(obstacles: Iterable[Obstacle]) -> list[str]:
    """Return the kinds of those that a plant offers."""
    return [part.kind for part in obstacles if isinstance(part, Contact)]


def contact_pairs(model: mujoco.MjModel) -> set[frozenset[int]]:
    """Return the two geoms of each pair that an obstacle added to a model."""
    pairs = [*_pairs(model, HIT), *_pairs(model, RUB)]
    return {frozenset((int(model.pair_geom1[i]), int(model.pair_geom2[i]))) for i in pairs}


def _pairs(model: mujoco.MjModel, sort: str) -> list[int]:
    return [i for i in range(model.npair) if model.pair(i).name.startswith(sort)]


@functools.cache
def _takes(
    build: Callable[[int], mujoco.MjSpec], n: int, edit: Callable[[mujoco.MjSpec], None]
) -> set[str]:
    """Return which of friction and restitution the pairs of a contact have."""
    spec = build(n)
    edit(spec)
    sorts = {pair.name.partition(":")[0] + ":" for pair in spec.pairs}
    taken = set()
    for name, sort in (("friction", RUB), ("restitution", HIT)):
        if sort in sorts:
            taken.add(name)
    return taken


def damping_ratio(restitution: float) -> float:
    """Return the damping ratio zeta of a spring and dashpot with this restitution, 0.01 .. 1."""
    # wanted `_loss`, which grows with zeta: 0 at 0, 1 at 1
    aim = -0.5 * math.log(max(restitution, MIN_RESTITUTION))
    low = 0.0
    high = 1.0 + aim
    high *= high
    while high - low > 1e-12 * high:
        zeta = 0.5 * (low + high)
        if _loss(zeta) < aim:
            low = zeta
        else:
            high = zeta
    return 0.5 * (low + high)


def _loss(zeta: float) -> float:
    """Return -ln(e) / 2, with e the restitution at a damping ratio."""
    if abs(zeta - 1.0) < 1e-6:
        return 1.0 + 2.0 / 3.0 * (zeta - 1.0)
    if zeta < 1.0:
        return zeta * math.acos(zeta) / math.sqrt(1.0 - zeta * zeta)
    return zeta * math.acosh(zeta) / math.sqrt(zeta * zeta - 1.0)


def solref(
    restitution: float, impedance: float, depth: float = 0.0, directions: float = 3.0
) -> Pair:
    """Return solref, MuJoCo's time constant in s and damping ratio, for a restitution of bodies
    that move on a line; `depth` in m per m/s, 0 for that of the library's contacts.

    The acceleration is a = a0 + A f, with A the inverse mass that the blow meets. MuJoCo sets f =
    (aref - a0) / (A + R) with R = A' (1 - d) / d. Its estimate A' of A is the mean over three
    directions, here A / 3, but A itself for a joint's limit and for a free body: `directions` = 1.
    So the spring and the dashpot act with the share A / (d A + (1 - d) A').
    """
    e = max(restitution, MIN_RESTITUTION)
    zeta = max(damping_ratio(e), 1e-6)  # MuJoCo divides by it
    share = 1.0 / (impedance + (1.0 - impedance) / directions)
    if not depth:
        depth = DEPTH_OF_BOBS if impedance == SOFT_IMPEDANCE else DEPTH
    second = zeta / math.sqrt(share)
    return share * depth / (math.sqrt(e) * zeta), second


# helpers for plants: pairs and obstacles


def hit(
    spec: mujoco.MjSpec, geoms: tuple[str, str], restitution: float, both_move: bool = False
) -> None:
    """Let two geoms hit each other, without friction."""
    impedance = SOFT_IMPEDANCE if both_move else FIRM_IMPEDANCE
    add_pair(spec, HIT, geoms, solref(restitution, impedance), impedance, 0.0)


def rub(spec: mujoco.MjSpec, geoms: tuple[str, str], friction: float) -> None:
    """Let two geoms slide on each other under a normal force."""
    add_pair(spec, RUB, geoms, SOLREF_RUB, SOFT_IMPEDANCE, friction)


def add_pair(
    spec: mujoco.MjSpec, sort: str, geoms: tuple[str, str], normal: Pair, d: float, friction: float
) -> None:
    """Add a contact pair with the solref of its normal, its impedance d and its friction."""
    spec.option.disableflags &= ~mujoco.mjtDisableBit.mjDSBL_CONTACT.value
    if sort == RUB:
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.impratio = IMPRATIO
    spec.add_pair(
        name=f"{sort}{geoms[0]}:{geoms[1]}",
        geomname1=geoms[0],
        geomname2=geoms[1],
        condim=3 if sort == RUB else 1,
        friction=(friction, friction, *TURNING_FRICTION),
        solref=normal,
        solreffriction=SOLREF_SLIDE,
        solimp=(d, d, *REST_OF_SOLIMP),
    )


def solid(body: mujoco.MjsBody, name: str, low: Sequence[float], high: Sequence[float]) -> None:
    """Add an invisible box behind a visible face: so deep that no blow passes through it."""
    block = box(body, name, low, high, "ink")
    block.group = 5
    block.rgba = (0.0, 0.0, 0.0, 0.0)


def box(
    body: mujoco.MjsBody, name: str, low: Sequence[float], high: Sequence[float], material: str
) -> mujoco.MjsGeom:
    """Add a box between two corners, m in the body's frame, and return its geom."""
    a = np.array(low, float)
    b = np.array(high, float)
    kind = mujoco.mjtGeom.mjGEOM_BOX
    return body.add_geom(name=name, type=kind, pos=(a + b) / 2, size=(b - a) / 2, material=material)


def bar(
    body: mujoco.MjsBody,
    name: str,
    ends: Ends,
    radius: float,
    material: str,
    round_ends: bool = False,
) -> None:
    """Add a round bar between two points, m in the body's frame."""
    kinds = mujoco.mjtGeom
    kind = kinds.mjGEOM_CAPSULE if round_ends else kinds.mjGEOM_CYLINDER
    body.add_geom(
        name=name, type=kind, fromto=(*ends[0], *ends[1]), size=(radius, 0, 0), material=material
    )
