"""Chromium, for pages that the package or its documentation makes."""

import contextlib
import os
import shutil

import pytest

BROWSERS = ("chromium", "chromium-headless-shell", "chromium-browser", "google-chrome")


@contextlib.contextmanager
def browser():
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        hint = "no Chromium to open pages in: apt-get install chromium"
        pytest.fail(hint) if os.environ.get("CI") else pytest.skip(hint)
    sync = pytest.importorskip("playwright.sync_api")
    with sync.sync_playwright() as play:
        yield play.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
