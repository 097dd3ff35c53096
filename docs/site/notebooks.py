"""The notebooks as pages: their text and code, and below each cell what it shows when it runs.

The site's cache keeps the outputs beside the figures. They are made again when the package changes.
"""

import base64
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import figures

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "notebooks"
LISTED = "notebooks.md"  # the page that lists them
KERNEL = Path(__file__).parent / "kernel.py"
POINTER = re.compile(r"No pictures here\?.*\n\n")  # to the page itself
FILM = re.compile(r'src="data:video/mp4;base64,([^"]+)"')


def names() -> list[str]:
    """Return the names of the notebooks, in the order of the page that lists them."""
    return re.findall(
        r"\(notebooks/(\w+)\.ipynb\)", (ROOT / "docs" / LISTED).read_text(encoding="utf-8")
    )


def outputs(name: str) -> bytes:
    """Run a notebook and return its cells' outputs as JSON."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, KERNEL, FOLDER / f"{name}.ipynb", "shown.json"]
        subprocess.run(command, cwd=folder, env=os.environ | {"PYTHONPATH": str(ROOT)}, check=True)
        return (Path(folder) / "shown.json").read_bytes()


def pages() -> dict[str, str | bytes]:
    """Return path -> text of a page, or picture or film that a page shows."""
    depends = [KERNEL, *FOLDER.glob("*.ipynb"), *(ROOT / "smc_mujoco" / "studies").rglob("*.py")]
    content_by_key = figures.figures([(outputs, (name,)) for name in names()], depends)
    files_by_path: dict[str, str | bytes] = {}
    for name in names():
        parts, files = _page(name, json.loads(content_by_key["outputs", name]))
        files_by_path |= {f"notebooks/{name}.md": "\n\n".join(parts)} | files
    return files_by_path


def _page(name: str, shown: list[list[dict[str, str]]]) -> tuple[list[str], dict[str, str | bytes]]:
    """Return the parts of a notebook's page as Markdown, and path -> content of its pictures and
    films.
    """
    cells = json.loads((FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]
    of_cell = iter(shown)
    files = {}
    parts = []
    for cell in cells:
        text = "".join(cell["source"])
        if cell["cell_type"] != "code":
            parts.append(_linked(POINTER.sub("", text)))
            continue
        parts.append(f"```python\n{text}\n```")
        for output in next(of_cell):
            parts.append(_output(output, f"{name}-{len(files)}", files))
    parts[0] += f"\n\n[The notebook]({name}.ipynb) to run and to change; [how](../{LISTED})."
    return parts, files


def _linked(text: str) -> str:
    """Return text in which names of other notebooks and pages lead to them on the site."""
    return re.sub(r"`docs/(\w+\.md)`", r"[`docs/\1`](../\1)", text.replace(".ipynb)", ".md)"))


def _output(output: dict[str, str], stem: str, files: dict[str, str | bytes]) -> str:
    """Return what a cell shows as Markdown; a picture or film goes to `files`."""
    if picture := output.get("image/png"):
        files[f"notebooks/{stem}.png"] = base64.b64decode(picture)
        # large when it is clicked
        return f"[![Figure]({stem}.png){{ .output loading=lazy }}]({stem}.png)"
    if html := output.get("text/html"):
        if film := FILM.search(html):
            files[f"notebooks/{stem}.mp4"] = base64.b64decode(film[1])
            html = f'<video src="{stem}.mp4" controls loop muted autoplay playsinline></video>'
        return f'<div class="output">{html}</div>'
    return f"```text {{ .output }}\n{output['text/plain'].rstrip()}\n```"
