"""Run the cells of a notebook in IPython, as a notebook's kernel does, and write what each shows as
JSON.

python kernel.py NOTEBOOK FILE [BEFORE [AFTER]]    # code that runs first and last

FILE gets a list for each cell: its outputs, MIME type -> content, pictures in base64. What is
printed is text/plain.
"""

import base64
import json
import sys
from pathlib import Path

from IPython.core.interactiveshell import InteractiveShell
from IPython.utils.capture import capture_output
from traitlets.config import Config


class ZMQInteractiveShell(InteractiveShell):
    """IPython's shell under the name of a notebook's, by which progress bars and smc.show know
    one.
    """

    def enable_gui(self, gui=None):
        """Do nothing: figures are shown in cells, without a window."""


def main() -> None:
    """Run the notebook in the current folder; end with status 1 at the first cell that fails."""
    notebook, file, *more = sys.argv[1:]
    cells = json.loads(Path(notebook).read_text("utf-8"))["cells"]
    before, after = [*more, "", ""][:2]
    config = Config(
        InteractiveShell={"ipython_dir": str(Path.cwd())}, HistoryManager={"enabled": False}
    )
    shell = ZMQInteractiveShell.instance(config=config)
    shell.enable_matplotlib("inline")
    _shown(shell, before)
    outputs = []
    for cell in cells:
        if cell["cell_type"] == "code":
            outputs.append(_shown(shell, "".join(cell["source"])))
    _shown(shell, after)
    Path(file).write_text(json.dumps(outputs))


def _shown(shell: InteractiveShell, code: str) -> list[dict[str, str]]:
    """Run a cell and return its outputs, without those that are updated while it runs, progress
    bars, and without warnings.
    """
    # run_cell would set its own hook in place of the capture
    with shell.display_trap, capture_output() as caught:
        done = shell.run_cell(code)
    if not done.success:
        sys.exit(caught.stderr + caught.stdout)
    if caught.stdout:
        printed = [{"text/plain": caught.stdout}]
    else:
        printed = []
    return printed + [
        {kind: _text(content) for kind, content in output.data.items()}
        for output in caught.outputs
        if not output.transient
    ]


def _text(content: str | bytes) -> str:
    if isinstance(content, bytes):
        return base64.b64encode(content).decode()
    return content


if __name__ == "__main__":
    main()
