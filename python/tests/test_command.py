"""The command of the package does what the program does."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import ROOT

COMMAND = [str(Path(sys.executable).with_name("beamcast"))]
PROGRAM = os.environ.get("BEAMCAST")

ARGUMENTS = [
    ["--version"], ["--help"], ["presets"], ["presets", "ouster/os1-128"], ["schema", "keys"], ["nonsense"], [],
    ["lint", "configs/street_128.toml"], ["lint", "none.toml"], ["info", "scenes/street.glb"], ["info", "none.glb"],
    ["scan", "configs/street_128.toml", "--dry-run", "--set", "sensor.0.range.max_m=x"], ["diff", "a.exr", "b.exr"],
    ["completions", "bash"], ["man"],
]


def run(command, arguments, **options):
    return subprocess.run([*command, *arguments], cwd=ROOT, capture_output=True, **options)


@pytest.mark.skipif(PROGRAM is None, reason="BEAMCAST names no program")
@pytest.mark.parametrize("arguments", ARGUMENTS, ids=" ".join)
def test_outputs_and_exit_codes_are_the_programs(arguments):
    ours, theirs = run(COMMAND, arguments), run([PROGRAM], arguments)
    assert (ours.returncode, ours.stdout, ours.stderr) == (theirs.returncode, theirs.stdout, theirs.stderr)


@pytest.mark.skipif(PROGRAM is None, reason="BEAMCAST names no program")
def test_a_scan_writes_the_same_files(job_file, tmp_path):
    for command, folder in ((COMMAND, "ours"), ([PROGRAM], "theirs")):
        done = run(command, ["scan", "-q", str(job_file), "--out", str(tmp_path / folder)])
        assert done.returncode == 0, done.stderr
    files = sorted(path.relative_to(tmp_path / "ours") for path in (tmp_path / "ours").rglob("*") if path.is_file())
    assert len(files) > 16
    for name in files:
        assert (tmp_path / "ours" / name).read_bytes() == (tmp_path / "theirs" / name).read_bytes(), name


def test_exit_codes():
    assert run(COMMAND, ["presets"]).returncode == 0
    assert run(COMMAND, ["nonsense"]).returncode == 2
    assert run(COMMAND, ["info", "none.glb"]).returncode == 3
    assert run([sys.executable, "-m", "beamcast"], ["--version"]).stdout == run(COMMAND, ["--version"]).stdout


def test_a_closed_pipe_is_no_error():
    done = subprocess.run(f"{COMMAND[0]} schema keys | head -1; echo ${{PIPESTATUS[0]}}", shell=True, executable="/bin/bash", capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "0" and not done.stderr


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signals_end_it_with_their_code(job_file, tmp_path, number, code):
    process = subprocess.Popen(
        [*COMMAND, "scan", str(job_file), "--out", str(tmp_path / "out"), "--set", "sequence.frames=100000"],
        stderr=subprocess.PIPE, stdout=subprocess.PIPE,
    )
    deadline = time.monotonic() + 30
    while not list((tmp_path).glob("out/**/*.npz")) and time.monotonic() < deadline:
        time.sleep(0.05)
    process.send_signal(number)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == code, errors
    assert b"Traceback" not in errors
