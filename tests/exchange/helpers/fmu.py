"""An importer of FMUs as small as can be, and what FMUs of other tools are made of."""

import re
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import fmpy
from fmpy.simulation import instantiate_fmu

from smc_mujoco.exchange.c import build

HERE = Path(__file__).parent


class Importer:
    """One instance of an FMU of FMI 3.0, past its initialization mode unless that is left to the
    test.
    """

    def __init__(
        self,
        path: Path,
        folder: Path,
        events: bool = False,
        early: bool = False,
        begin: bool = True,
        **first,
    ):
        if not folder.exists():
            fmpy.extract(str(path), str(folder))
        about = fmpy.read_model_description(str(folder))
        self.at = {variable.name: variable.valueReference for variable in about.modelVariables}
        self.said: list[str] = []
        self.fmu: Any = instantiate_fmu(
            str(folder),
            about,
            "CoSimulation",
            event_mode_used=events,
            early_return_allowed=early,
            logger=lambda *words: self.said.append(words[-1].decode()),
        )
        if begin:
            self.begin(**first)

    def begin(self, start: float = 0.0, **first: float) -> None:
        self.fmu.enterInitializationMode(startTime=start)
        self.set(**first)
        self.fmu.exitInitializationMode()

    def set(self, **values: float) -> None:
        """Set variables; a name's dots are written as two underscores."""
        named = {}
        for name, value in values.items():
            named[name.replace("__", ".")] = value
        self.fmu.setFloat64([self.at[name] for name in named], list(named.values()))

    def get(self, *names: str) -> list[float]:
        return self.fmu.getFloat64([self.at[name] for name in names])

    def step(self, t: float, h: float = 1e-3, **inputs: float) -> list[float]:
        """Set inputs, step, and return u and s."""
        self.set(**inputs)
        self.fmu.doStep(t, h)
        return self.get("u", "s")


def fmi2(folder: Path, about: str = (HERE / "fmi2.xml").read_text()) -> Path:
    """An FMU of FMI 2.0, from fmi2.c; `about` is its description."""
    return archived(folder, [HERE / "fmi2.c"], "controller", fmpy.platform, about)


def fmi3(folder: Path) -> Path:
    """An FMU of FMI 3.0, from fmi3.c, which has inputs that are not real numbers, and steps every 5
    ms.
    """
    header = (Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h").read_text(encoding="utf-8")
    own = (HERE / "fmi3.c").read_text(encoding="utf-8")
    missing = {*re.findall(r"\bfmi3\w+(?=TYPE\b)", header)} - {*re.findall(r"fmi3\w+", own)}
    (folder / "missing.c").write_text(
        "".join(f"int {name}(void) {{ return 3; }}\n" for name in sorted(missing))
    )
    about = (HERE / "fmi3.xml").read_text()
    return archived(
        folder, [HERE / "fmi3.c", folder / "missing.c"], "servo", fmpy.platform_tuple, about
    )


def archived(folder: Path, sources: list[Path], name: str, system: str, about: str) -> Path:
    """C files as an FMU with a binary for this machine."""
    headers = Path(fmpy.__file__).parent / "c-code"
    library = folder / f"{name}.so"
    if not library.exists():
        command = [
            *build.compiler(),
            *build.LIBRARY_FLAGS,
            f"-I{headers}",
            *map(str, sources),
            "-o",
            str(library),
            "-lm",
        ]
        subprocess.run(command, check=True)
    with zipfile.ZipFile(folder / f"{name}.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", about)
        archive.write(library, f"binaries/{system}/{name}.so")
    return folder / f"{name}.fmu"
