"""Files of Python that are in no package, such as laws as users write them."""

import importlib.util
import sys


def loaded(path):
    """The module of a file that is in no package."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def strange(text, folder, monkeypatch):
    """The law `strange` of a file with this text."""
    (folder / "strange.py").write_text(text)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, "strange", raising=False)
    return importlib.import_module("strange").strange
