"""smc-mujoco live: plants and laws in a browser."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Terminal, errors_as_sentences
from smc_mujoco.common.interrupts import delay_ctrl_c

DEFAULT_PORT = 8000


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
    serve: Annotated[bool, typer.Option(help="Whether to serve the page on this machine, until Ctrl-C.")] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of --serve; 0 takes a free one.")] = DEFAULT_PORT,
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

    Example: smc-mujoco live duffing cart_pole --law my_law.py --serve
    """
    with delay_ctrl_c():
        from smc_mujoco.common.progress import bar
        from smc_mujoco.exchange.live.build import DEFAULT_PLANTS
        from smc_mujoco.exchange.live.build import live as build

    terminal = Terminal()
    with bar("the live page", shown=terminal.is_terminal):
        page = build(plants or DEFAULT_PLANTS, law or (), out)
    terminal.wrote(page)
    if serve:
        _serve(page.parent, port, terminal)
    else:
        terminal.note(f"serve it: python -m http.server --directory {page.parent}")


def _serve(folder: Path, port: int, terminal: Terminal) -> None:
    """Serve a folder, only to this machine, until Ctrl-C."""
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
