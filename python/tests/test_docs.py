"""The code of docs/python.md, of docs/scale.md and of the package's README runs, block after block."""

import importlib.util
import os
import re
import sys
from pathlib import Path

import pytest
from conftest import ROOT

PAGES = [ROOT / "docs" / "python.md", ROOT / "docs" / "scale.md", ROOT / "python" / "README.md"]
# The modules that a block may need and not find. Where BEAMCAST_RAY is set, Ray is there.
MAY_LACK = {"torch"} if "BEAMCAST_RAY" in os.environ else {"torch", "ray"}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_block_runs(page, tmp_path, monkeypatch):
    for folder in ("configs", "scenes"):
        Path(tmp_path, folder).symlink_to(ROOT / folder)
    monkeypatch.chdir(tmp_path)
    # The command of the package that is tested comes first.
    monkeypatch.setenv("PATH", os.path.dirname(sys.executable) + os.pathsep + os.environ["PATH"])
    blocks = re.findall(r"^```python\n(.*?)^```", page.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    assert blocks
    names, ran = {"__name__": "page"}, 0
    for block in blocks:
        needs = re.findall(r"^# needs: (\w+)$", block, re.MULTILINE)
        lacks = {module for module in needs if importlib.util.find_spec(module) is None}
        assert lacks <= MAY_LACK
        if not lacks:
            exec(compile(block, str(page), "exec"), names)
            ran += 1
    assert ran > len(blocks) / 2, "most of a page needs this package alone"
    if page.name == "python.md":
        assert Path("street.png").stat().st_size > 10_000
