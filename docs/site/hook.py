"""What the site adds to docs/:

README's first screen, films, notebooks, the C header, pages of laws and plants, tables of metrics,
scenes and claims, equations; what people type for a section, and llms.txt.
"""

import json
import re
import sys
import tomllib
from pathlib import Path

from mkdocs.plugins import event_priority
from mkdocs.structure.files import File

ROOT = Path(__file__).parents[2]
GALLERY = "videos/gallery"
HERE = "<!-- README's first screen -->"
START = "[Start](tutorial.md){ .md-button .md-button--primary }"  # above its first picture
CATALOGUE = "catalogue.md"  # its tables name all plants and laws
GROUP = "Catalogue"  # where the contents show their pages
HEADER = "smc_mujoco/exchange/c/smc_law.h"  # to which pages link

sys.path.insert(0, str(Path(__file__).parent))

from smc_mujoco.common.gl import choose_gl  # noqa: E402

choose_gl()  # else dm_control tries GLFW first, which asks for a display

import catalogue  # noqa: E402
import known  # noqa: E402
import llms  # noqa: E402
import notebooks  # noqa: E402
from mathml import font, typeset  # noqa: E402

PAGES: list[catalogue.Page] = []  # of this build
# in search, where 1.0 is usual: definitions come first
BOOST = {"words.md": 5.0, "recipes.md": 2.0, "mathematics.md": 2.0, "run_study.md": 1.5}
BOOST |= {"api.md": 0.3, "index.md": 0.5, "papers.md": 0.5} | dict.fromkeys(known.reference(), 0.2)


def on_config(config):
    """Put the notebooks and the pages of laws, plants and the reference into the contents."""
    start = next(entry["Start"] for entry in config.nav if "Start" in entry)
    below = [f"notebooks/{name}.md" for name in notebooks.names()]
    start[start.index(notebooks.LISTED)] = {"Notebooks": [notebooks.LISTED, *below]}
    next(entry["API"] for entry in config.nav if "API" in entry).extend(known.reference())
    place = next(entry[GROUP] for entry in config.nav if GROUP in entry)
    PAGES.clear()
    for section, groups in catalogue.pages().items():
        entries = []
        for group, pages in groups.items():
            listed = [{page.title: f"{page.path}.md"} for page in pages]
            entries += [{group: listed}] if group else listed
            PAGES.extend(pages)
        place.append({section: entries})
    return config


def on_files(files, config):
    """Add the gallery, the generated pages and their pictures to the site's files."""
    for path in sorted((ROOT / GALLERY).iterdir()):
        files.append(File.generated(config, f"{GALLERY}/{path.name}", abs_src_path=str(path)))
    files.append(File.generated(config, HEADER, abs_src_path=str(ROOT / HEADER)))
    for page in PAGES:
        files.append(File.generated(config, f"{page.path}.md", content=page.text))
        # a law before its variants, whose names are longer
        BOOST[f"{page.path}.md"] = 1.0 / len(re.split("[ -]", page.title))
    for path, content in (notebooks.pages() | known.reference()).items():
        files.append(File.generated(config, path, content=content))
        BOOST.setdefault(path, 0.3)
    for name in ("site.css", "iframe-worker.js", "search.js"):
        files.append(
            File.generated(
                config, f"assets/{name}", abs_src_path=str(ROOT / "docs" / "site" / name)
            )
        )
    files.append(File.generated(config, "assets/stix-two-math.ttf", content=font()))
    for path, picture in catalogue.files(catalogue.stills()).items():
        files.append(File.generated(config, path, content=picture))
    return files


def on_page_markdown(markdown, page, config, files):
    """Put README's first screen and the package's tables where the page asks for them, link names,
    and weigh the page for the search.
    """
    if boost := BOOST.get(page.file.src_uri):
        page.meta["search"] = {"boost": boost}
    first, _, _ = (
        (ROOT / "README.md")
        .read_text(encoding="utf-8")
        .partition("\n<!-- end of the first screen -->")
    )
    first = first.replace("\n![", f"\n{START}\n\n![", 1)
    markdown = known.filled(markdown.replace(HERE, first.replace("](docs/", "](")))
    for place in (f"{GALLERY}/", HEADER):
        markdown = markdown.replace(f"](../{place}", f"]({place}")
    if page.file.src_uri == notebooks.LISTED:
        markdown = markdown.replace(".ipynb)", ".md)")
    if page.file.src_uri == CATALOGUE:
        return linked(markdown)
    return markdown


def linked(markdown: str) -> str:
    """Return Markdown in which names of laws and plants in tables lead to their pages."""
    paths = {page.path.partition("/")[2]: f"{page.path}.md" for page in PAGES if "/" in page.path}

    def link(line: str) -> str:
        if not line.startswith("|"):
            return line
        return re.sub(
            r"`(\w+)`",
            lambda found: f"[{found[0]}]({paths[found[1]]})" if found[1] in paths else found[0],
            line,
        )

    return "\n".join(map(link, markdown.split("\n")))


def names_of(path: str) -> list[str]:
    """Return the words of a law or plant, apart and as one, from the path of its page."""
    parts = path.rpartition("/")[2].split("_")
    return [*parts, "".join(parts)] if "/" in path else []


def on_page_content(html, page, config, files):
    """Typeset the equations, and keep intervals such as (1 to 2) on one line."""
    return re.sub(r"(\([\d.e-]+) to ([\d.e-]+\))", r"\1&nbsp;to&nbsp;\2", typeset(html))


@event_priority(
    -50
)  # after the search has written its index, before it is copied for reading offline
def on_post_build(config):
    """Put what people type for a section into the search's index, and write llms.txt."""
    site = Path(config.site_dir)
    index = site / "search" / "search_index.json"
    search_index = json.loads(index.read_text(encoding="utf-8"))
    phrases = tomllib.loads((ROOT / "docs" / "site" / "phrases.toml").read_text(encoding="utf-8"))
    names = {f"{page.path}.html": names_of(page.path) for page in PAGES}
    for entry in search_index["docs"]:
        location = entry["location"]
        if words := [*names.get(location, ()), *phrases.pop(location, "").split()]:
            entry["tags"] = words
    if phrases:
        raise ValueError(f"phrases.toml names no section of the site: {sorted(phrases)}")
    index.write_text(json.dumps(search_index), encoding="utf-8")
    (site / "llms.txt").write_text(llms.text(config.nav, ROOT / "docs"), encoding="utf-8")
