"""Run the cells of a notebook in IPython, as a notebook's kernel does, and print as JSON what each has shown.

python notebook_kernel.py NOTEBOOK CODE    # CODE is a last cell, which is not in the notebook
"""

import json
import sys
from pathlib import Path

from IPython.core.displaypub import CapturingDisplayPublisher
from IPython.core.interactiveshell import InteractiveShell
from traitlets.config import Config

from smc_mujoco.draw.film import film

SPEED = 15.0  # of films: a few frames, which else take half of the time


class ZMQInteractiveShell(InteractiveShell):
    """IPython's shell under the name of a notebook's, by which progress bars and smc.show know one."""


def main() -> None:
    """Run the notebook in the current folder; end with status 1 at the first cell that fails."""
    path, last = sys.argv[1:]
    here = Config(InteractiveShell={"ipython_dir": str(Path.cwd())}, HistoryManager={"enabled": False})
    shell = ZMQInteractiveShell.instance(config=here)
    shell.display_pub = CapturingDisplayPublisher()
    assert shell.display_formatter is not None
    cells = [cell for cell in json.loads(Path(path).read_text("utf-8"))["cells"] if cell["cell_type"] == "code"]
    clock = film.clock
    film.clock = lambda traces, fps, speed: clock(traces, fps, SPEED)
    shown = []
    for source in [*("".join(cell["source"]) for cell in cells), last]:
        done = shell.run_cell(source)
        if not done.success:
            sys.exit(1)
        outputs = [output["data"] for output in shell.display_pub.outputs]
        shell.display_pub.outputs.clear()
        if done.result is not None:
            outputs.append(shell.display_formatter.format(done.result)[0])
        shown.append([{kind: str(value)[:200] for kind, value in output.items()} for output in outputs])
    Path("shown.json").write_text(json.dumps(shown))


if __name__ == "__main__":
    main()
