"""Laws in files, as users write them: the C export reads their source."""

import importlib
import sys


def strange(text, folder, monkeypatch):
    """The law `strange` of a file with this text."""
    (folder / "strange.py").write_text(text)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, "strange", raising=False)
    return importlib.import_module("strange").strange
