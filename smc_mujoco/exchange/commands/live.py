"""smc-mujoco live: plants and laws in a browser."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Terminal, errors_as_sentences
from smc_mujoco.common.interrupts import delay_ctrl_c


@errors_as_sentences()
def live(
    plants: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[PLANT...]",
            autocompletion=options.PLANTS,
            help="Plants with one motor; by default inverted_pendulum, duffing and van_der_pol.",
        ),
    ] = None,
    law: Annotated[
        list[str] | None,
        typer.Option(metavar="LAW|FILE", help="Your own law, in addition to the library's; may be repeated."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the page.")] = Path("live"),
) -> None:
    """Build a web page in which MuJoCo runs: choose laws, move sliders, push the machine, compare two laws.

    The page is a folder of files. Any web server can serve it without this package and without network, for example
    `python -m http.server --directory live`. The browser simulates the models of the package under its laws, translated
    to JavaScript, with the same sampling, delay, noise and integrator. Its traces are those of `smc-mujoco run` within
    rounding. The address of the page holds all that you set, so that a link shares it.

    `--law` takes a Python file with laws made by @smc.law_function, a law with gains such as "pid(kp=50, ki=1)", or
    gains.json that `smc-mujoco tune --out` wrote.

    The first build fetches MuJoCo for browsers and three.js (10 MB) with npm. Node.js has npm, and so has
    `pip install 'smc-mujoco[live]'`.

    Example: smc-mujoco live duffing cart_pole --law my_law.py
    """
    with delay_ctrl_c():
        from smc_mujoco.common.progress import bar
        from smc_mujoco.exchange.live.build import DEFAULT_PLANTS
        from smc_mujoco.exchange.live.build import live as build

    terminal = Terminal()
    with bar("the live page", shown=terminal.is_terminal):
        page = build(plants or DEFAULT_PLANTS, law or (), out)
    terminal.wrote(page)
    terminal.note(f"serve it: python -m http.server --directory {page.parent}")
