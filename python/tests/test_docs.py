"""The code of docs/python.md and of the package's README runs, block after block."""

import importlib.util
import re
from pathlib import Path

import pytest
from conftest import ROOT

PAGES = [ROOT / "docs" / "python.md", ROOT / "python" / "README.md"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_block_runs(page, tmp_path, monkeypatch):
    for folder in ("configs", "scenes"):
        Path(tmp_path, folder).symlink_to(ROOT / folder)
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```python\n(.*?)^```", page.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    assert blocks
    names, ran = {"__name__": "page"}, 0
    for block in blocks:
        needs = re.findall(r"^# needs: (\w+)$", block, re.MULTILINE)
        if all(importlib.util.find_spec(module) for module in needs):
            exec(compile(block, str(page), "exec"), names)
            ran += 1
    assert ran >= len(blocks) - 1
    if page.name == "python.md":
        assert Path("street.png").stat().st_size > 10_000
