# MuJoCo's compiled modules have no stubs: a type checker knows none of their names, and takes each for Any.
from typing import Any

def __getattr__(name: str) -> Any: ...
