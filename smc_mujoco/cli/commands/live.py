"""smc-mujoco live: plants and laws in a browser."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Terminal, errors_as_sentences
from smc_mujoco.common.interrupts import held_back

PORT = 8000


@errors_as_sentences()
def live(
    plants: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[PLANT...]",
            help="Plants with one motor; by default inverted_pendulum, duffing and van_der_pol.",
        ),
    ] = None,
    law: Annotated[
        list[str] | None,
        typer.Option(metavar="LAW|FILE.py", help="A law of your own, beside those of the library; may be repeated."),
    ] = None,
    out: Annotated[Path, typer.Option(help="The folder.")] = Path("live"),
    serve: Annotated[bool, typer.Option(help="Serve the folder on this machine afterwards, until Ctrl-C.")] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Where to serve; 0 takes a free port.")] = PORT,
) -> None:
    """Build a web page in which MuJoCo runs: choose laws, move sliders, push the machine, compare two laws.

    The page is a folder of files. Every web server can serve it, also without network, as
    `python -m http.server --directory live` does; it needs nothing of this package then. The browser simulates the
    package's own models under its own laws, translated to JavaScript, with the same sampling, delay, noise and
    integrator: its traces are those of `smc-mujoco run` within rounding. The address of the page holds the setting, so
    that a link shares it.

    `--law` takes a Python file with laws made by @smc.law_function, a law with gains such as "pid(kp=50, ki=1)", or a
    .json file that `smc-mujoco tune` wrote.

    The first build fetches MuJoCo for browsers and three.js with npm (10 MB), which Node.js or `pip install
    'smc-mujoco[live]'` brings.

    Example: smc-mujoco live duffing cart_pole --law my_law.py --serve
    """
    with held_back():
        from smc_mujoco.common.progress import bar
        from smc_mujoco.draw.live.build import PLANTS
        from smc_mujoco.draw.live.build import live as build

    terminal = Terminal()
    own = [made for text in law or () for made in options.laws_of(text)]
    with bar("the live page", shown=terminal.is_terminal):
        page = build(plants or PLANTS, own, out)
    terminal.wrote(page)
    if serve:
        _serve(page.parent, port, terminal)
    else:
        terminal.note(f"serve it: python -m http.server --directory {page.parent}")


def _serve(folder: Path, port: int, terminal: Terminal) -> None:
    """Serve a folder on this machine alone, until Ctrl-C."""
    import contextlib
    import functools
    from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

    from smc_mujoco.common.errors import ScenarioError

    class Quiet(SimpleHTTPRequestHandler):
        """A handler that prints no line for each request."""

        def log_message(self, format: str, *args: object) -> None:
            """Print nothing."""

    try:
        bound = ThreadingHTTPServer(("127.0.0.1", port), functools.partial(Quiet, directory=str(folder)))
    except OSError as error:
        raise ScenarioError(f"cannot serve at port {port} ({error.strerror}): give another --port") from None
    with bound as server:
        terminal.note(f"open http://127.0.0.1:{server.server_port}/ (Ctrl-C ends it)")
        with contextlib.suppress(KeyboardInterrupt):
            server.serve_forever()
