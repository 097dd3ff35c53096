"""The constraints of a user's model: whether it can have any, whether they give way, and whether
dry friction holds.
"""

import copy
import math
from collections.abc import Callable

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.mechanisms.hardware.part import HARD_SOLIMP, HARD_SOLREF
from smc_mujoco.mechanisms.layout import loaded, posed
from smc_mujoco.mechanisms.plant import Plant

SOFT_SOLREF = (0.02, 1.0)  # MuJoCo's default of solreffriction
SOFT_SOLIMP = (0.9, 0.95, 0.001, 0.5, 2.0)  # of solimpfriction
MAX_GIVE = 2e-3  # rad (m) for a blow of 1 rad/s (m/s): a warning tells of more; chosen
MIN_GIVE = 5e-5  # rad (m) under the weight, of which a warning is silent; chosen
MAX_CREEP = 1e-6  # rad/s (m/s) of dry friction: a warning tells of more; chosen
TEST_STEP = 2.5e-4  # s, at which softness is measured: that of runs with constraints
# MuJoCo's noslip pass, which keeps stuck joints from creeping: the most iterations, and tolerance
NOSLIP = 100, 1e-12
FLAGS = mujoco.mjtDisableBit


def touches(model: mujoco.MjModel) -> bool:
    """Return whether two geoms may meet, by their bodies and masks, or a pair of the file."""
    if model.npair:
        return True
    if model.opt.disableflags & FLAGS.mjDSBL_CONTACT.value:
        return False
    first, second = np.triu_indices(model.ngeom, 1)
    masks = model.geom_contype[first] & model.geom_conaffinity[second]
    masks |= model.geom_contype[second] & model.geom_conaffinity[first]
    body = model.body_weldid[model.geom_bodyid]
    parent = model.body_weldid[model.body_parentid[body]]
    a = body[first]
    b = body[second]
    # the world is no parent here, as MuJoCo does not count it
    child = (parent[first] == b) & (b > 0)
    parent_of = (parent[second] == a) & (a > 0)
    kin = (a == b) | child | parent_of
    return bool(np.any((masks != 0) & ~kin))


def smooth(model: mujoco.MjModel, rubs: bool = False) -> bool:
    """Return whether no constraint is possible: no limits, contacts, equalities, or dry friction.
    With `rubs`, dry friction of joints does not count.
    """
    if model.opt.disableflags & FLAGS.mjDSBL_CONSTRAINT.value:
        return True
    collides = (model.geom_contype > 0) | (model.geom_conaffinity > 0)
    touching = np.any(collides) or model.npair
    limited = np.any(model.jnt_limited) or np.any(model.tendon_limited)
    dry = np.any(model.tendon_frictionloss) or (np.any(model.dof_frictionloss) and not rubs)
    return not (
        (touching and not model.opt.disableflags & FLAGS.mjDSBL_CONTACT.value)
        or (limited and not model.opt.disableflags & FLAGS.mjDSBL_LIMIT.value)
        or dry
        or model.neq
    )


def harden(spec: mujoco.MjSpec, touching: Callable[[], bool]) -> None:
    """Make dry friction hold, where the file does not say how softly: MuJoCo's default creeps.
    `touching` says whether two geoms may meet.
    """
    hard = []
    for part in (*spec.joints, *spec.tendons):
        if part.frictionloss > 0.0 and np.array_equal(part.solref_friction, SOFT_SOLREF):
            hard.append(part)
    for part in hard:
        part.solref_friction = HARD_SOLREF
        part.solimp_friction = HARD_SOLIMP
    if hard and not touching():
        hold(spec)


def hold(spec: mujoco.MjSpec) -> None:
    """Let MuJoCo's noslip pass hold dry friction, if all of it is hard: of the file, and of parts,
    whose level is not in the model yet.
    """
    dry = []
    for part in (*spec.joints, *spec.tendons):
        hard = np.array_equal(part.solref_friction, HARD_SOLREF)
        if hard or part.frictionloss > 0.0:
            dry.append(hard)
    if dry and all(dry) and not spec.option.noslip_iterations:
        spec.option.noslip_iterations, spec.option.noslip_tolerance = NOSLIP


def default_friction(model: mujoco.MjModel) -> bool:
    """Return whether joints have dry friction, and the file does not say how soft it is."""
    dry = model.dof_frictionloss > 0.0
    return bool(np.any(dry) and np.all(model.dof_solref[dry] == SOFT_SOLREF))


def sets_friction_solref(model: mujoco.MjModel, dof: int) -> bool:
    """Return whether a model's file says how soft the dry friction of a joint is."""
    return tuple(model.dof_solref[dof]) not in (SOFT_SOLREF, HARD_SOLREF)


def softness_warnings(label: str, made: Plant) -> list[str]:
    """Return warnings: a sentence each on contacts, joint limits and equality constraints that give
    way to a blow of 1 rad/s (m/s) by more than MAX_GIVE, and one on dry friction that creeps.
    """
    model = copy.copy(loaded(made))
    model.opt.timestep = TEST_STEP
    data = posed(model, made.x0)
    mujoco.mj_forward(model, data)
    if model.opt.disableflags & FLAGS.mjDSBL_CONSTRAINT.value:
        return []
    sentences = _giving(label, model, data)
    if not (made.smooth or model.opt.noslip_iterations):  # which hold dry friction exactly
        sentences += _creeping(label, model, data)
    return sentences


def _giving(label: str, model: mujoco.MjModel, data: mujoco.MjData) -> list[str]:
    """Return a sentence on each kind of constraint that gives way by more than MAX_GIVE.

    A soft constraint is a spring of frequency w and damping ratio z. A blow of speed v deflects it
    by v/w/(1 + (e - 1) z) within 4 %, and at rest an acceleration a by (1 - d) a/w^2, with its
    impedance d. Here a is that of the weight at the start.
    """
    sentences = []
    turns = "mrad (mm)", "rad/s (m/s)"

    def tell(
        kind: str,
        option: str,
        units: tuple[str, str],
        solref: Array,
        solimp: Array,
        load: float | Array,
    ) -> None:
        first, second = solref.T
        # a time constant and a damping ratio, or a stiffness and a damping, both negative
        roots = np.sqrt(np.abs(first))
        w = np.where(first > 0.0, 1.0 / np.abs(first * second), roots)
        of_pair = -second / (2.0 * w)
        z = np.where(first > 0.0, second, of_pair)
        decay = 1.0 + (math.e - 1.0) * z
        blow = np.max(1.0 / (w * decay), initial=0.0)
        loose = 1.0 - solimp[:, 1]
        rest = np.max(loose * load / w**2, initial=0.0)
        if blow > MAX_GIVE:
            way, speed = units
            weight = f", and by {1e3 * rest:.1g} {way} under the weight" if rest > MIN_GIVE else ""
            sentences.append(
                f"{kind} of {label} give way by {1e3 * blow:.2g} {way} if hit at 1 {speed}"
                f"{weight}: a smaller first number of {option} makes them harder"
            )

    off = model.opt.disableflags
    gravity = float(np.linalg.norm(model.opt.gravity))
    if touches(model):
        touching = (model.geom_contype > 0) | (model.geom_conaffinity > 0)
        geoms = model.geom_solref[touching], model.geom_solimp[touching]
        tell("contacts", "solref", ("mm", "m/s"), *geoms, gravity)
    limited = np.flatnonzero(model.jnt_limited)
    if not off & FLAGS.mjDSBL_LIMIT.value:
        pushed = np.abs(data.qacc_smooth[model.jnt_dofadr[limited]])
        limits = model.jnt_solref[limited], model.jnt_solimp[limited]
        tell("joint limits", "solreflimit", turns, *limits, pushed)
    if not off & FLAGS.mjDSBL_EQUALITY.value:
        held = model.eq_active0 > 0
        ties = model.eq_solref[held], model.eq_solimp[held]
        tell("equality constraints", "solref", turns, *ties, gravity)
    return sentences


def _creeping(label: str, model: mujoco.MjModel, data: mujoco.MjData) -> list[str]:
    """Return a sentence if dry friction creeps by more than MAX_CREEP.

    Friction that holds F creeps by R F/b, with MuJoCo's regularisation R and damping b.
    """
    kinds = mujoco.mjtConstraint
    dry = np.isin(data.efc_type, (kinds.mjCNSTR_FRICTION_DOF, kinds.mjCNSTR_FRICTION_TENDON))
    slack = data.efc_R[dry] / data.efc_KBIP[dry, 1]
    creep = np.max(slack * data.efc_frictionloss[dry], initial=0.0)
    if not creep > MAX_CREEP:
        return []
    joints = model.dof_solref[model.dof_frictionloss > 0.0]
    tendons = model.tendon_solref_fri[model.tendon_frictionloss > 0.0]
    solrefs = np.vstack([joints, tendons])
    of_file = not np.all(solrefs == HARD_SOLREF)
    # what it holds once the soft constraints have given way
    model.dof_solimp[:, :2] = model.tendon_solimp_fri[:, :2] = HARD_SOLIMP[:2]
    mujoco.mj_forward(model, data)
    forces = np.abs(data.efc_force[dry])
    under = np.max(slack * forces)
    at_start = f"by {under:.2g} rad/s (m/s) under the weight at the start, and "
    cure = 'nothing creeps without contacts (<flag contact="disable"/>)'
    if of_file:
        cure = "leave out the solreffriction in the file"
    return [
        f"the dry friction of {label} creeps {at_start if under > MAX_CREEP else ''}"
        f"by {creep:.2g} rad/s (m/s) where it holds all that it can: {cure}"
    ]
