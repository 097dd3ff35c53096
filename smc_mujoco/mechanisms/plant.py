"""A plant: a MuJoCo mechanism, its equation x'' = f(x, v) + g u, and the map between them.

A plant's file describes the mechanism in three ways, and tests check that they agree: its MJCF
(what MuJoCo simulates), `fields` (which model fields a parameter sets) and `nominal` (the f and g
that a model-based law uses). A channel is one measured degree of freedom: first those with an
actuator, then the free joints, which have none. Its actuator, its two sensors and its body are
found in the compiled model.
"""

import dataclasses
import functools
import inspect
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal, NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array, Floats, Names, Numbers, Pair
from smc_mujoco.common.constraints import Number
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import MAX_ITEMS, ScenarioError, find, shown, unknown, whole
from smc_mujoco.common.files import shipped
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.mjcb import compiled_spec
from smc_mujoco.common.registry import Catalogue, catalogue_of
from smc_mujoco.mechanisms import rotation

DIRECT_TEXT = "smc:direct"  # name of a text in models on whose joints, not bodies, disturbances act
# unit of a force, from that of x, or of x' in a speed loop
EFFORT = {"rad": "N m", "m": "N", "rad/s": "N m", "m/s": "N"}
# rad or m, chosen: how far beyond its range a joint may start, because MuJoCo's limits are soft
MAX_EXCESS = 1e-3
TINY = 1e-12  # SI units; least value of a parameter above 0 that is neither a mass nor a length
OF_GEOMS = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE.value
MAX_PARAMETER = 1e15  # SI units; no parameter of a mechanism is larger

OF_FILE = re.compile(r"\.(xml|urdf|mjb)\b")  # a text that names a model's file
Values = SimpleNamespace  # parameters by name: p.m, p.l, ...
Range = tuple[str, float, float]  # joint, least and largest position, rad or m


class Field(NamedTuple):
    """One write into an MjModel: model.<name>[place] = value ('opt.gravity' for an option), or +=
    where it adds.
    """

    name: str
    place: Any
    value: Any
    adds: bool = False  # whether the value is added to the present one


def geom_fields(
    model: mujoco.MjModel,
    name: str,
    pos: Floats = (),
    size: tuple[int, float] | None = None,
) -> Iterator[Field]:
    """Yield the fields of a geom, its place and one of its sizes (index, value); none in a run that
    leaves it out.
    """
    if (geom := mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name)) < 0:
        return
    if pos:
        yield Field("geom_pos", geom, pos)
    if size:
        yield Field("geom_size", (geom, size[0]), size[1])


class Variant(NamedTuple):
    """An alternative mechanism of a plant: an edit of its MjSpec, and the fields that its
    parameters then set.
    """

    edit: Callable[[mujoco.MjSpec], None]
    fields: Callable[[mujoco.MjModel, Values], Iterator[Field]]


# What a nominal model reads: a channel i, their number n, the addresses of measured x, v and of the
# last u, (n,) each.
SEEN = np.dtype([(name, "i8") for name in ("i", "n", "x", "v", "u")])


class Native(NamedTuple):
    """A nominal model as a C function."""

    address: int
    values: Floats
    alive: tuple  # the objects whose addresses are among the values


class Dynamics(NamedTuple):
    """The nominal M x'' + h = force of all channels.

    M is (n, n), h (n,), and g (n,), the h at rest.
    """

    M: Array
    h: Array
    g: Array


@keyword_dataclass
class Plant:
    """A mechanism with n channels obeying x'' = f(x, v) + g(x) (u + d)."""

    name: str  # as in `smc.plants()`
    # name -> value, SI units; the nominal ones, which laws may know
    parameters: Numbers
    mass: str  # parameter that is meant by "mass" in a mismatch or a jump
    unit: str  # of x, "rad" or "m"; that of the first channel if they differ
    x0: Floats  # default initial positions, those of the paper study, (n,)
    rest: Floats = ()  # positions that the default reference holds, (n,); empty: 0
    n: int = 1  # number of channels
    sizes: tuple[int, int] = (1, 1)  # smallest and largest n that `smc.plant(name, n=...)` takes
    build: Callable[[int], mujoco.MjSpec]  # n -> the ideal mechanism with the default parameters
    # the model fields which the parameters set
    fields: Callable[[mujoco.MjModel, Values], Iterator[Field]]
    # (x, v, i, p) -> f and g of channel i, from x and v of all channels, (n,) each, and nominal
    # parameters p
    nominal: Any
    # Kind of contact -> edit of the MjSpec that adds its obstacles and contact pairs
    contacts: Mapping[str, Callable[[mujoco.MjSpec], None]] = dataclasses.field(
        default_factory=dict
    )
    # Name -> another mechanism, which realises the equation, or a part of it, by other means
    mechanisms: Mapping[str, Variant] = dataclasses.field(default_factory=dict)
    # units of all channels if they differ, (n,); `units` has them in both cases
    mixed: Names = ()
    underactuated: bool = False  # whether each driven channel has a partner without an actuator
    measured: int = 0  # number of further channels without an actuator, which come last
    base: int = -1  # first of the six channels of a measured free base, its pose; -1: it has none
    # where its free joints should come to rest, (free,), rad or m; empty: at 0
    goal: Floats = ()
    # Parameter -> the only value that fits the geometry of the contacts
    placed: Numbers = dataclasses.field(default_factory=dict)
    # Name -> unit ("": none) of the parameters that are 0 by default, such as a payload: a mismatch
    # or a jump adds its number to such a parameter, in this unit, instead of multiplying it
    added: Mapping[str, str] = dataclasses.field(default_factory=dict)
    # Of a free body, whose channels are its pose: x, y, z, and its rotation vector. "all": its
    # actuators exert any force and torque; "heading": they do not, as rotors that push one way, so
    # its tilt follows from the force. Else ""
    pose: Literal["", "all", "heading"] = ""
    direct: bool = (
        False  # whether disturbances act on its joints, not on the bodies that they carry
    )
    smooth: bool = (
        True  # whether its model has no limits, contacts, dry friction and equality constraints
    )
    # whether the joints of a user's model have dry friction, which is not counted in `smooth`
    rubs: bool = False
    # Parameter -> lowest and highest factor (or number to add, for those in `added`) that a user
    # may meet. `smc.worst_case` varies these parameters if it is given no class
    uncertain: Mapping[str, Pair] = dataclasses.field(
        default_factory=dict, compare=False, repr=False
    )
    # parameters that are dry friction. A plant with one that is not 0 is not smooth
    dry: Names = ()
    unmodelled: str = ""  # why there is no nominal model; "" if there is one
    # hardware.part.Friction of its joints according to its source, for a scenario; or None
    friction: Any = None
    # N m or N, largest force of each driven channel's motor; empty: no limits
    limits: Floats = ()
    reach: Callable[[Values], Floats] | None = (
        None  # `limits` of other parameters, if they depend on them
    )
    # name -> parameters, a published set
    sets: Mapping[str, Numbers] = dataclasses.field(default_factory=dict)
    # parameters that must be greater than 0, beside masses and lengths
    above_zero: Names = ()
    ranges: tuple[Range, ...] = ()  # joint, lowest and highest x of each channel; empty: no limits
    label: str = ""  # long and short name in figures; "": made from its name
    short: str = ""
    # "mild" or "hard" -> parameter -> factor of the jump in the suite's condition of that size
    jumps: Mapping[str, Numbers] = dataclasses.field(default_factory=dict)
    tip: str = ""  # site that the mechanism moves: where an arm's tool is
    # "law", "u_max" or "reference" -> what each driven channel suggests to a scenario that leaves
    # it out
    suggested: Mapping[str, tuple] = dataclasses.field(
        default_factory=dict, compare=False, repr=False
    )

    def __post_init__(self):
        for name in ("parameters", "contacts", "mechanisms", "placed", "added"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        for name in ("jumps", "sets"):
            parts = {}
            for key, part in getattr(self, name).items():
                parts[key] = frozen(part)
            object.__setattr__(self, name, frozen(parts))

    def __repr__(self) -> str:
        values = [repr(self.name)]
        if self.n > 1:
            values.append(f"n={self.n}")
        for name, value in self.parameters.items():
            values.append(f"{name}={value:g}")
        return f"plant({', '.join(values)})"

    @property
    def positive(self) -> frozenset[str]:
        """Parameters that must be greater than 0: masses, lengths, and those of `above_zero`."""
        return frozenset({self.mass, "M", "m", "l", *self.above_zero}) & frozenset(self.parameters)

    def constraint(self, parameter: str) -> Number:
        """Return what a parameter may be."""
        if parameter in self.positive:
            low = TINY if parameter in self.above_zero else 1e-6
        elif self._is_natural(parameter):
            low = 0.0
        else:
            low = -MAX_PARAMETER
        return Number(low=low, high=MAX_PARAMETER)

    def _is_natural(self, parameter: str) -> bool:
        """Return whether a parameter is 0 or more, as the numbers of a user's joints and bodies."""
        return parameter in (*self.dry, *self.added) or "." in parameter

    @property
    def driven(self) -> int:
        """The number of channels with an actuator, which come first. Their partners without an
        actuator, one for each or none, come next.
        """
        moved = self.n - self.measured
        return moved // 2 if self.underactuated else moved

    @property
    def by_mujoco(self) -> bool:
        """Whether MuJoCo computes its nominal model, a `custom.nominal_model.NominalModel`."""
        return hasattr(self.nominal, "native_dynamics")

    @property
    def free(self) -> int:
        """The number of channels without an actuator, which come last and are only measured."""
        return self.n - self.driven

    @property
    def scored_channels(self) -> tuple[int, ...]:
        """The channels whose errors count: all, but not the tilt of a free body that follows from
        the force, nor where on its floor a measured base is.
        """
        if self.pose == "heading":
            return (0, 1, 2, 5)
        uncounted = (self.base, self.base + 1) if self.base >= 0 else ()
        return tuple(i for i in range(self.n) if i not in uncounted)

    @property
    def units(self) -> Names:
        """Unit of x of each channel, (n,)."""
        return self.mixed or (self.unit,) * self.n

    @property
    def efforts(self) -> Names:
        """Unit of the force on each channel, (n,)."""
        return tuple(EFFORT[unit] for unit in self.units)

    @property
    def network(self) -> bool:
        """Whether several channels have an actuator and the same unit, so that they can be compared
        with each other.
        """
        return self.driven > 1 and len(set(self.units[: self.driven])) == 1

    @property
    def is_user_model(self) -> bool:
        """Whether it is a user's model, not one of the library."""
        return hasattr(type(self.build), "argument")  # no value is made

    @property
    def has_user_joints(self) -> bool:
        """Whether its channels are joints of a user's model, not the pose of its body."""
        return self.is_user_model and not self.pose

    @property
    def has_path(self) -> bool:
        """Whether films show its path: an arm's tip, or a free body's."""
        return bool(self.tip or self.pose)

    @property
    def on_stage(self) -> bool:
        """Whether its MJCF is built on models/common/theme.xml: films put such machines on one
        floor, in one light.
        """
        return not self.is_user_model and _on_stage(self.build, self.n)

    @property
    def argument(self) -> str:
        """Its name on the command line; for a user's model FILE.xml:joint+joint."""
        return getattr(self.build, "argument", self.name)

    @property
    def origin(self) -> Floats:
        """Positions from which starts are measured, (n,): the default goal of a user's model or of
        a free body, else 0.
        """
        if self.rest and (self.is_user_model or self.pose):
            return self.rest
        return (0.0,) * self.n

    def errors(self, x: Array, r: Array) -> Array:
        """Return x - r, (..., n); of an attitude, the rotation vector from the reference's to the
        body's, rad.
        """
        if self.pose and x.shape[1] == self.n:  # a group's x is r + e
            return rotation.pose_errors(x, r)
        return x - r

    def spec(self) -> mujoco.MjSpec:
        """Return the mechanism as an editable MjSpec, with default parameters."""
        return self.build(self.n)

    @property
    def file(self) -> Path:
        """The file that has the code of its builder, or a user's model."""
        code = self.build if inspect.isroutine(self.build) else type(self.build)
        return Path(getattr(self.build, "file", "") or inspect.getfile(code))

    def load(
        self,
        factors: Numbers | None = None,
        nuserdata: int = 0,
        spec: mujoco.MjSpec | None = None,
    ) -> mujoco.MjModel:
        """Compile the ideal plant, with factors on its parameters by name, and mjData.userdata of
        length nuserdata.

        `spec`: its own, with additions.
        """
        numbers = whole("nuserdata", nuserdata, 0, MAX_ITEMS)
        model = compiled_for_runs(spec or self.spec(), numbers)
        values = self.values(factors or {})
        write_fields(model, self.fields(model, values))
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return model

    def change(self, factors: Numbers) -> str:
        """Return a change of the parameters in words: "m × 1.3, payload + 2 kg". Factors are those
        of `values`.
        """
        texts = []
        for name, factor in factors.items():
            if name in self.added:
                sign = "−" if factor < 0.0 else "+"
                texts.append(f"{name} {sign} {abs(factor):g} {self.added[name]}".rstrip())
            else:
                texts.append(f"{name} × {factor:g}")
        return ", ".join(texts)

    def __getattr__(self, name: str) -> Any:
        """Say where a parameter is."""
        words = f"plant has no attribute {name!r}"
        if name in vars(self).get("parameters", {}):
            words += f": its parameter is plant.parameters[{name!r}]"
        raise AttributeError(words)

    def values(self, factors: Numbers) -> Values:
        """Return the parameters, each times its factor, or with it added; `mass` stands for the
        plant's mass.
        """
        values = dict(self.parameters)
        for key, factor in factors.items():
            name = self.mass if key == "mass" else key
            if name not in values:
                raise unknown(f"parameter of {self.name}", key, [*values, "mass"])
            if factor <= 0.0 and name in self.positive:
                raise ScenarioError(
                    f"factor {factor:g} on {self.name}'s {key}: give a number greater than 0"
                )
            if name in self.added:
                values[name] = values[name] + factor
            else:
                values[name] = values[name] * factor
        for name, value in values.items():
            too_low = (value <= 0.0 and name in self.positive) or (
                value < 0.0 and self._is_natural(name)
            )
            if not abs(value) <= MAX_PARAMETER or too_low:
                raise ScenarioError(
                    f"{self.name}'s true {name} becomes {value:g}: give other factors"
                )
        return Values(**values)


@functools.cache
def _on_stage(build: Callable[[int], mujoco.MjSpec], n: int) -> bool:
    """Return whether a mechanism has the floor and the accent of the theme, and a body `machine`
    with all else.
    """
    spec = build(n)
    return None not in (
        spec.body("machine"),
        spec.geom("floor"),
        spec.material("floor"),
        spec.material("accent"),
    )


def compiled_for_runs(spec: mujoco.MjSpec, nuserdata: int) -> mujoco.MjModel:
    """Compile a spec for runs with userdata of that length."""
    spec.nuserdata = nuserdata
    # otherwise MuJoCo would reset a diverging run to the initial state and continue
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET.value
    return compiled_spec(spec)


def leave_out_scenery(spec: mujoco.MjSpec) -> None:
    """Have a model compiled without geoms that touch nothing and their meshes, half of a
    humanoid's, if its inertias are not of all geoms.
    """
    spec.compiler.discardvisual = spec.compiler.inertiafromgeom != OF_GEOMS


def write_fields(model: mujoco.MjModel, fields: Iterator[Field]) -> None:
    """Write fields into a model."""
    for name, place, value, adds in fields:
        values = field_array(model, name)
        values[place] = values[place] + value if adds else value


def field_array(model: mujoco.MjModel, name: str) -> Array:
    """Return the array of a model or option field that a Field names."""
    if name.startswith("opt."):
        owner = model.opt
    else:
        owner = model
    return getattr(owner, name.removeprefix("opt."))


def check_ranges(
    plant: str, ranges: Iterable[Range], x0: Iterable[float], units: Iterable[str]
) -> None:
    """Raise ScenarioError for a start outside a joint's range."""
    for (joint, low, high), x, unit in zip(ranges, x0, units, strict=False):
        if not low - MAX_EXCESS <= x <= high + MAX_EXCESS:
            outside = f"outside its range from {low:g} to {high:g}"
            raise ScenarioError(
                f"x0 of joint {joint!r} of {plant} is {x:g}, {outside}: give another x0"
                f"{degrees_hint((low, high), x, unit)}"
            )


def degrees_hint(ends: tuple[float, float], x: float, unit: str) -> str:
    """Return a clause for a range that was written in rad and read in degrees, as x within the
    same numbers in rad suggests; "" for others.
    """
    low, high = (math.degrees(end) for end in ends)
    if unit != "rad" or max(-low, high) > math.tau or not low <= x <= high:
        return ""
    return (
        f". If the file means {low:.4g} to {high:.4g} rad: MuJoCo reads degrees unless it has "
        '<compiler angle="radian"/>'
    )


def model_path(name: str) -> Path:
    """Return the path of the MJCF file models/<name>."""
    return shipped("models") / name


def model_spec(name: str) -> mujoco.MjSpec:
    """Return the MjSpec of the MJCF file models/<name>."""
    return mujoco.MjSpec.from_file(str(model_path(name)))


@functools.cache
def plant_catalogue() -> Catalogue[Plant]:
    """Return every plant of smc_mujoco.mechanisms.plants and of other packages, by name."""
    return catalogue_of("smc_mujoco.mechanisms.plants", Plant, "smc_mujoco.plants")


def plant(name: str, *, set: Any = None, **parameters: float) -> Plant:
    """Return the plant `name`, with some of its parameters (or its size n) changed, else a
    ScenarioError.

        smc.plant("duffing", M=1.2)

    `set` is the name of one of the plant's `sets` of numbers, such as plant("quadrotor",
    set="gym").

    Returns:
      A Plant.
    """
    if isinstance(name, str) and OF_FILE.search(name):
        raise ScenarioError(
            f"plant is {shown(name)}: a model of your own is smc.plant_from(file, [joints])"
        )
    base = find("plant", name, plant_catalogue())
    size = parameters.pop("n", base.n)
    n = whole(f"n of {name}", size, *base.sizes)
    values = dict(base.parameters)
    values.update(find(f"set of {name}", set, base.sets) if set is not None else {})
    for key, value in parameters.items():
        if key not in values:
            raise unknown(f"parameter of {name}", key, [*values, "n"])
        values[key] = base.constraint(key)(f"{name}'s {key}", value)
    x0 = tuple(base.x0[i % len(base.x0)] for i in range(n))
    smooth = base.smooth
    if base.dry:
        smooth = not any(values[key] for key in base.dry)
    limits = base.limits
    if base.reach:
        limits = base.reach(Values(**values))
    return dataclasses.replace(base, parameters=values, n=n, x0=x0, smooth=smooth, limits=limits)


def plants() -> list[str]:
    """List the names that `plant` knows. `smc-mujoco list duffing` says what one is: its equation,
    in SI units, and its parameters.

        smc.plants()

    Returns:
      Names, in alphabetical order.
    """
    return list(plant_catalogue())
