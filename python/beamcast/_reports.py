"""Checks and comparisons. They run the command in a process of its own, and read its JSON."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from . import errors


class Report:
    """What a check or a comparison found.

    Attributes:
        is_fine: Whether there is no difference beyond the tolerances, and no expectation failed.
        text: What the command prints for people.
        data: What it writes as JSON (docs/json.md).
    """

    def __init__(self, is_fine: bool, text: str, data: dict[str, Any]) -> None:
        """Reports come from `check` and `diff`."""
        self.is_fine = is_fine
        self.text = text
        self.data = data

    def __bool__(self) -> bool:
        return self.is_fine

    def __repr__(self) -> str:
        return f"<beamcast.Report: {'fine' if self.is_fine else 'different'}>\n{self.text}"


def check(
    *paths: str | os.PathLike[str],
    overrides: Mapping[str, Any] | None = None,
    accept: bool = False,
    junit: str | os.PathLike[str] | None = None,
    html: str | os.PathLike[str] | None = None,
    threads: int | None = None,
) -> Report:
    """Runs jobs, and holds their frames to baselines and expectations, as `beamcast check` does.

    Args:
        paths: Jobs, and folders of jobs.
        overrides: Keys that win over the jobs', as in `Job`.
        accept: Whether what the jobs give now becomes their baselines.
        junit: A file for JUnit XML.
        html: A file for a page with pictures.
        threads: The threads to work on.

    Returns:
        The report. A job that can't be run is in it, with the places of its problems, and makes it not fine.

    Raises:
        UsageError: There is nothing to check.
    """
    from ._job import _toml

    options = [f"--set={key}={_toml(value)}" for key, value in (overrides or {}).items()]
    options += ["--accept"] if accept else []
    options += [f"--{name}={os.fspath(path)}" for name, path in (("junit", junit), ("html", html)) if path is not None]
    options += _threads(threads)
    with tempfile.TemporaryDirectory(prefix="beamcast-") as folder:
        file = Path(folder, "check.json")
        done = _run(["check", f"--json={file}", *options, "--", *paths])
        data = json.loads(file.read_text("utf-8")) if file.exists() else None
    if data is None:
        raise _error(done)
    return Report(done.returncode == 0, done.stdout, data)


def diff(
    a: str | os.PathLike[str],
    b: str | os.PathLike[str],
    *,
    tolerances: Mapping[str, float | str] | None = None,
    pixels: float = 0.0,
    threads: int | None = None,
) -> Report:
    """Compares two outputs channel by channel, as `beamcast diff` does.

    Args:
        a: A range image, a cloud, a folder that a scan wrote, or a job, which is run.
        b: The same, to compare with.
        tolerances: By how much channels may differ: `{"range": 0.001, "intensity": "1%"}`.
        pixels: The part of the pixels that may differ by more, 0 to 1.
        threads: The threads to work on.

    Raises:
        UsageError, InputError: A side can't be read.
    """
    options = [f"--tolerance={name}={value}" for name, value in (tolerances or {}).items()]
    done = _run(["diff", "--json", f"--pixels={pixels}", *options, *_threads(threads), "--", a, b])
    if done.returncode not in (0, 1):
        raise _error(done)
    data = json.loads(done.stdout)
    return Report(done.returncode == 0, done.stderr, data)


def _threads(threads: int | None) -> list[str]:
    return [f"--threads={threads}"] if threads else []


def _run(arguments: Iterable[str | os.PathLike[str]]) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "beamcast", *(os.fspath(argument) for argument in arguments)]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", errors="replace", check=False)
    if done.returncode in (130, 143, -2, -15):
        raise KeyboardInterrupt
    return done


def _error(done: subprocess.CompletedProcess[str]) -> errors.Error:
    kinds = {2: errors.UsageError, 3: errors.InputError, 4: errors.OutputError}
    message = done.stderr.strip().removeprefix("error: ")
    return kinds.get(done.returncode, errors.Error)(message)
