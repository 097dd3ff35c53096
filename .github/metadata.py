"""The README and the links of a release, from one address: `repository` in pyproject.toml.

The package index shows the README outside of the repository, where relative links lead nowhere.
With an address they become absolute. Without one they are left out, and so are the release's own.
"""

import re
from pathlib import Path

from hatchling.metadata.plugin.interface import MetadataHookInterface

TARGET = re.compile(r"\]\((?!https?:|#)(?P<target>[^)]+)\)")  # of a relative link, or of a picture
PICTURES = (".webp", ".png", ".svg")
LINK = re.compile(r"\[([^\]]*)\]" + TARGET.pattern.removeprefix(r"\]"))
FROM_A_FILE = "../../"  # how a badge's link leaves the folder of the branch


def absolute(text: str, repository: str) -> str:
    """Return Markdown with its relative links and pictures as addresses in a repository's main
    branch.
    """

    def replaced(link: re.Match) -> str:
        target = link["target"]
        if target.startswith(FROM_A_FILE):
            return f"]({repository}/{target.removeprefix(FROM_A_FILE)})"
        return f"]({repository}/{'raw' if target.endswith(PICTURES) else 'blob'}/main/{target})"

    return TARGET.sub(replaced, text)


def without_links(text: str) -> str:
    """Return Markdown without relative pictures, and with the words alone of relative links."""
    return LINK.sub(lambda found: found[1], re.sub("!" + LINK.pattern, "", text))


class Metadata(MetadataHookInterface):
    """Fills in what depends on the repository's address."""

    def update(self, metadata: dict) -> None:
        text = (Path(self.root) / "README.md").read_text("utf-8")
        repository = self.config["repository"].rstrip("/")
        metadata["urls"] = {}
        if repository:
            text = absolute(text, repository)
            metadata["urls"] = {
                "Documentation": f"{repository}/blob/main/docs/index.md",
                "Repository": repository,
                "Changes": f"{repository}/blob/main/CHANGELOG.md",
                "Issues": f"{repository}/issues",
            }
        else:
            text = without_links(text)
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
