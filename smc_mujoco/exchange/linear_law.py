"""Linear controllers as laws: transfer functions and state-space models, of python-control or as
matrices.

    import control
    lead = control.tf([40, 100], [0.01, 1])                       # u = K(s) (r - x)
    smc.run(smc.Scenario(plant="duffing", law=smc.exchange.law_from_control(lead)))

A controller of continuous time is discretised by Tustin's rule (bilinear, without prewarping) with
the control period of the run. In real Schur form A is triangular but for 2 x 2 blocks, so each
sample solves (I - A h/2) x = b from below. The law is written out as straight Python without loops,
which is compiled and exported like any other law.
"""

import contextlib
import dataclasses
import warnings
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.common import errors
from smc_mujoco.common.aliases import Array, Floats, Names
from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.control.law import Law, law_function
from smc_mujoco.control.units import Gain, Unit
from smc_mujoco.control.written import Matrix, WrittenLaw, state_feedback

INPUTS = {  # what a controller may read -> expression of the law's measurement
    "error": "y.r - y.x",
    "error_rate": "y.dr - y.v",
    **{name: f"y.{name}" for name in ("x", "v", "q", "dq", "r", "dr", "ddr")},
}
DEFAULT_INPUTS = ("error", "error_rate")
MATRICES = ("A", "B", "C", "D")  # attributes of a linear system of states
POLYNOMIALS = ("num", "den")  # and of a transfer function
MAX_STATES = 50
CURE = "give a TransferFunction or StateSpace, (A, B, C, D, dt), or an array of gains"


class System(NamedTuple):
    """x' = a x + b w, u = c x + d w; or x+ = a x + b w if dt is not None, with dt s (or True: of
    any period).
    """

    a: Array
    b: Array
    c: Array
    d: Array
    dt: float | bool | None


@dataclasses.dataclass(frozen=True)
class LinearLaw(WrittenLaw):
    """The function of a linear controller's law. Its s is x - r."""

    a: Matrix  # in real Schur form if the controller is of continuous time
    b: Matrix
    c: Floats
    d: Floats
    inputs: Names  # keys of INPUTS
    name: str  # of the law
    discrete: bool  # whether the matrices give the step of one control period
    control_period: float | None  # s, of the run for which that step is; None for any

    @cached_property
    def text(self) -> str:
        """The law in Python."""
        lines = [f"w{j} = {INPUTS[name]}" for j, name in enumerate(self.inputs)]
        if self.discrete:
            lines += self._step_lines()
        else:
            lines += self._tustin_lines()
        return "def controller(y, gains, memory):\n" + "".join(
            f"    {line}\n" for line in [*lines, "return u, y.e"]
        )

    def _output_line(self) -> str:
        return f"u = gains.scale * ({_sum_of_products([(self.c, 'x'), (self.d, 'w')])})"

    def _step_lines(self) -> list[str]:
        lines = [f"x{i} = memory[{i}]" for i in range(len(self.a))]
        lines.append(self._output_line())
        for i, (a, b) in enumerate(zip(self.a, self.b, strict=True)):
            lines.append(f"memory[{i}] = {_sum_of_products([(a, 'x'), (b, 'w')])}")
        return lines

    def _tustin_lines(self) -> list[str]:
        """Return the lines of x = (I - A h/2)^-1 (z + h/2 B w), u = C x + D w, z+ = 2 x - z, with z
        in memory.
        """
        n = len(self.a)
        last = len(self.a) - 1
        lines = ["h = 0.5 * y.dt"] if self.a else []
        while last >= 0:  # blocks, from below
            first = last
            if last > 0 and self.a[last][last - 1]:
                first -= 1
            for k in range(first, last + 1):
                rest = self.a[k][last + 1 :]
                solved = [0.0] * (last + 1) + list(rest)
                read = _sum_of_products([(solved, "x"), (self.b[k], "w")])
                lines.append(f"f{k} = memory[{k}] + h * ({read})")
            lines += _block_lines(self.a, first, last)
            last = first - 1
        lines.append(self._output_line())
        for i in range(n):
            lines.append(f"memory[{i}] = 2.0 * x{i} - memory[{i}]")
        return lines


def _block_lines(a: Matrix, first: int, last: int) -> list[str]:
    """Return the lines that solve a block of (I - A h/2) x = f: one equation, or two by Cramer's
    rule.
    """
    if first == last:
        return [f"x{first} = f{first} / (1.0 - h * {a[first][first]!r})"]
    i = first
    j = last
    p = f"(1.0 - h * {a[i][i]!r})"
    t = f"(1.0 - h * {a[j][j]!r})"
    q = f"(-h * {a[i][j]!r})"
    r = f"(-h * {a[j][i]!r})"
    return [
        f"det = {p} * {t} - {q} * {r}",
        f"x{i} = (f{i} * {t} - {q} * f{j}) / det",
        f"x{j} = ({p} * f{j} - {r} * f{i}) / det",
    ]


def _sum_of_products(parts: Sequence[tuple[Sequence[float], str]]) -> str:
    """Return a sum of products as text, without those with 0."""
    terms = []
    for values, name in parts:
        for i, value in enumerate(values):
            if value:
                terms.append(f"{value!r} * {name}{i}")
    return " + ".join(terms) or "0.0"


def law_from_control(
    K: Any, inputs: Sequence[str] | str | None = None, name: str = "linear_controller"
) -> Law:
    """Return a linear controller as a law of one channel, or K of the whole state as a law of many.

        K = [[40.0, 8.0]]  # of the error and its rate
        law = smc.exchange.law_from_control(K, inputs=["error", "error_rate"])

    Args:
      K: a TransferFunction or StateSpace of python-control (or scipy), with one output u, N or N m;
        or matrices (A, B, C, D) or (A, B, C, D, dt). Without dt, or with dt = 0, it is of
        continuous time, and discretised by Tustin's rule with the control period of the run. With
        dt = True it is the step of any control period; with dt in s, of that control period. Or an
        array of gains, (1, m), such as the K of control.lqr: u = K w for the m inputs w, which is
        -K (x - r, v - r') for error and error_rate. Or, without `inputs`, an array (driven, 2n):
        u = -K (x - r, v - r') of all n channels in the plant's order, driven or only measured.
      inputs: what K reads, in its order: error (r - x), error_rate (r' - v), x, v, r, dr, ddr, and
        q, dq of the joint without actuator that this one moves. Default: error, and error_rate if K
        has two inputs.
      name: of the law.

    The law has one gain, `scale`, a factor of K, which `smc.tune` searches. It has no anti-windup.
    For another discretisation give `control.sample_system(K, h, "zoh")`.

    Returns:
      A Law.

    Raises:
      ScenarioError: K is none of these, improper, not finite, of several outputs or over 50 states,
        or has other inputs than are named.
    """
    errors.name("name of the controller", name)
    if inputs is None and (gain_matrix := _of_all_channels(K)) is not None:
        return state_feedback(gain_matrix, name)
    system = _checked(_system(K))
    states = len(system.a)
    count = system.b.shape[1]
    names = _names(inputs, count)
    discrete = system.dt is not None
    a, b, c = _state_space(system)
    function = LinearLaw(
        a=_rows(a),
        b=_rows(b),
        c=_rows(c)[0],
        d=_rows(system.d)[0],
        inputs=names,
        name=name,
        discrete=discrete,
        control_period=None if system.dt in (None, True) else float(system.dt),
    )
    decorate = law_function(
        gains={"scale": Gain(1.0, Unit(), positive=True)},
        memory=max(states, 1),
        family="linear",
        continuous=True,
    )
    return decorate(function)()


def _state_space(system: System) -> tuple[Array, Array, Array]:
    """Return A, B and C of a system; in continuous time A is in real Schur form."""
    if system.dt is not None or not len(system.a):
        return system.a, system.b, system.c
    from scipy.linalg import schur

    a, basis, *_ = schur(system.a, output="real")
    return a, basis.T @ system.b, system.c @ basis


def _names(inputs: str | Iterable[str] | None, count: int) -> tuple[str, ...]:
    """Return the names of a controller's inputs."""
    if inputs is None:
        names = DEFAULT_INPUTS[:count]
    elif isinstance(inputs, str):
        names = (inputs,)
    else:
        names = tuple(errors.items_of("inputs", inputs))
    for name in names:
        errors.find("input of a controller", name, INPUTS)
    if len(names) != count:
        raise ScenarioError(
            f"K has {count} inputs, and {len(names)} are named: give inputs=, such as ['r', 'x']"
        )
    return names


def _of_all_channels(K: Any) -> Array | None:
    """Return K as an array of one row for each driven channel and two columns for each of several
    channels; None if it is something else.
    """
    if not isinstance(K, np.ndarray | list | tuple):
        return None
    try:
        gains = np.array(K, float)
    except (TypeError, ValueError):
        return None
    rows, columns = gains.shape if gains.ndim == 2 else (0, 0)
    if columns < max(4, 2 * rows) or columns % 2:
        return None
    return gains


def has_attributes(thing: Any, names: Iterable[str]) -> bool:
    """Say whether a thing has all of these attributes."""
    return all(hasattr(thing, name) for name in names)


def _rows(matrix: Array) -> Matrix:
    return tuple(map(tuple, matrix.tolist()))


def _system(K: Any) -> System:
    """Return what the user gave as matrices."""
    if isinstance(K, tuple | list) and len(K) in (4, 5):
        return _matrices(*[*K, None][:5])  # pyright: ignore[reportCallIssue] five of them
    if isinstance(K, tuple | list) and K:
        with contextlib.suppress(TypeError, ValueError):
            K = np.asarray(K, float)
    if has_attributes(K, MATRICES):
        return _matrices(K.A, K.B, K.C, K.D, getattr(K, "dt", None))  # pyright: ignore[reportAttributeAccessIssue] see the line above
    if isinstance(K, np.ndarray) and K.ndim in (1, 2):
        return _matrices([], [], [], K, None)
    if has_attributes(K, POLYNOMIALS):
        return _realisation(K.num, K.den, getattr(K, "dt", None))  # pyright: ignore[reportAttributeAccessIssue] see the line above
    raise ScenarioError(f"K is {shown(K)}: {CURE}")


def _matrices(a: Any, b: Any, c: Any, d: Any, dt: Any) -> System:
    """Return matrices as arrays of two axes; a number is a matrix of 1 x 1, and a list is the
    column b or a row.
    """
    try:
        arrays = []
        for matrix in (a, b, c, d):
            array = np.asarray(matrix)
            if np.iscomplexobj(array):
                raise ValueError
            arrays.append(array.astype(float))
        a, b, c, d = arrays
        if b.ndim == 1:
            b = b[:, None]
        a, b, c, d = map(np.atleast_2d, (a, b, c, d))
        if not a.size:
            a = np.zeros((0, 0))
            b = np.zeros((0, d.shape[1]))
            c = np.zeros((len(d), 0))
    except (TypeError, ValueError):
        raise ScenarioError(f"K has matrices that are not of real numbers: {CURE}") from None
    return System(a, b, c, d, dt)


def _realisation(num: Any, den: Any, dt: Any) -> System:
    """Return matrices of a row of transfer functions, each with separate states."""
    from scipy.linalg import block_diag
    from scipy.signal import BadCoefficients, tf2ss

    if np.ndim(den[0]) == 0:  # one of scipy
        num = [[num]]
        den = [[den]]
    if len(num) != 1:
        raise ScenarioError(
            f"K has {len(num)} outputs: give one with one output, u, such as K[0, :]"
        )
    forms = []
    for above, below in zip(num[0], den[0], strict=True):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", BadCoefficients)  # leading zeros, which are cut off
            try:
                form = tf2ss(np.atleast_1d(above), np.atleast_1d(below))
                forms.append(form)
            except ValueError:
                numerator = len(np.trim_zeros(above, "f")) - 1
                denominator = len(np.trim_zeros(below, "f")) - 1
                cure = "filter its derivative, as s / (tau s + 1)"
                order = f"{numerator} over {denominator}"
                raise ScenarioError(f"K is improper, of order {order}: {cure}") from None
    a, b, c, d = zip(*forms, strict=True)  # of each transfer function
    return _matrices(block_diag(*a), block_diag(*b), np.hstack(c), np.hstack(d), dt)


def _checked(K: System) -> System:
    """Return a system whose sizes fit, of finite numbers, and with None for a dt of continuous
    time.
    """
    n = len(K.a)
    inputs = K.d.shape[1]
    outputs = len(K.d)
    shapes = {
        "A": (K.a, (n, n)),
        "B": (K.b, (n, inputs)),
        "C": (K.c, (outputs, n)),
        "D": (K.d, (outputs, inputs)),
    }
    for name, (matrix, shape) in shapes.items():
        if matrix.shape != shape:
            raise ScenarioError(
                f"K's {name} is {_size(matrix.shape)}: give {_size(shape)}, as A and D have it"
            )
        if not np.isfinite(matrix).all():
            raise ScenarioError(f"K's {name} is not finite: {CURE}")
    if outputs != 1:
        raise ScenarioError(
            f"K has {outputs} outputs: give one with one output, u, such as K[0, :]"
        )
    if n > MAX_STATES:
        raise ScenarioError(
            f"K has {n} states: give {MAX_STATES} at most, by control.balred or control.minreal"
        )
    if K.dt is True:
        return K
    if K.dt is None:
        dt = 0.0
    else:
        dt = errors.number("dt of K", K.dt, low=0.0)
    return K._replace(dt=dt or None)


def _size(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))
