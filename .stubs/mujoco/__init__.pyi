# MuJoCo's compiled modules have no stubs: a type checker takes each of their names for Any.
from typing import Any

def __getattr__(name: str) -> Any: ...
