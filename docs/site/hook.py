"""What the pages show from outside of docs/: README's first screen on the first page, and the gallery's pictures."""

from pathlib import Path

from mkdocs.structure.files import File

ROOT = Path(__file__).parents[2]
GALLERY = "videos/gallery"
HERE = "<!-- README's first screen -->"


def on_files(files, config):
    """Add the gallery to the site's files."""
    for path in sorted((ROOT / GALLERY).glob("*.webp")):
        files.append(File.generated(config, f"{GALLERY}/{path.name}", abs_src_path=str(path)))
    return files


def on_page_markdown(markdown, page, config, files):
    """Put README's first screen where the page asks for it, and point its pictures at the site's."""
    first, _, _ = (ROOT / "README.md").read_text(encoding="utf-8").partition("\n[docs/](")
    return markdown.replace(HERE, first).replace(f"](../{GALLERY}/", f"]({GALLERY}/")
