"""Scenarios and laws as bytes for another process, with the code that it cannot import.

Pickle names a function by its module. A script or notebook is the module `__main__`, but a worker has another
`__main__`. A law in a function or an executed file has no module at all. cloudpickle sends their code by value.
"""

import copyreg
import io
import pickle
from typing import Any

from smc_mujoco.common.errors import ScenarioError, one_line
from smc_mujoco.control.component import Component

SCRIPTS = ("__main__", "__mp_main__")  # modules that differ from process to process


def packed(thing: Any) -> bytes:
    """Return a thing as bytes for `pickle.loads` in any process that has this package, and cloudpickle if needed."""
    try:
        data = pickle.dumps(thing)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        return _by_value(thing, one_line(str(error)))
    return _by_value(thing, "it is in a script") if any(name.encode() in data for name in SCRIPTS) else data


def _by_value(thing: Any, why: str) -> bytes:
    """Return a thing with the code of scripts and of functions in functions."""
    try:
        import cloudpickle
    except ImportError:
        cure = "put it into a module, or pip install cloudpickle"
        raise ScenarioError(f"a law, signal or part cannot be sent to another process ({why}): {cure}") from None

    class Pickler(cloudpickle.Pickler):
        """Pickler that writes a script's component by its fields, not by its name."""

        def reducer_override(self, obj: Any) -> Any:
            if isinstance(obj, Component) and getattr(obj.function, "__module__", "") in SCRIPTS:
                return copyreg.__newobj__, (Component,), vars(obj)  # type: ignore[attr-defined]
            return super().reducer_override(obj)

    buffer = io.BytesIO()
    try:
        Pickler(buffer).dump(thing)
    except Exception as error:  # whatever an object's own methods raise
        raise ScenarioError(
            f"a law, signal or part cannot be sent to another process ({one_line(str(error))}): use plain functions "
            "and numbers"
        ) from None
    return buffer.getvalue()
