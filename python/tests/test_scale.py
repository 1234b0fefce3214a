"""The scripts of docs/scale.md for Slurm and Kubernetes, with processes of this machine in place of tasks and pods."""

import json
import os
import re
import shutil
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import COMMAND, ROOT, assert_same, files

yaml = pytest.importorskip("yaml")

SLURM, KUBERNETES = (ROOT / "docs" / "scale" / name for name in ("slurm.sh", "kubernetes.yaml"))

# Runs what it is given as Slurm does: the tasks of an array at the same time, and what depends on them if all have ended well.
SBATCH = """#!{python}
import os, re, subprocess, sys
state = os.environ["FAKE_SLURM"]
options = dict(re.match("--([a-z-]+)=?(.*)", one, re.S).groups() for one in sys.argv[1:])
job = str(len(os.listdir(state)) + 1)
environment = {{**os.environ, "SLURM_CPUS_PER_TASK": "1"}}
if array := options.get("array"):
    first, last = map(int, array.split("-"))
    of_array = {{"SLURM_ARRAY_TASK_MIN": str(first), "SLURM_ARRAY_TASK_COUNT": str(last - first + 1)}}
    tasks = [
        subprocess.Popen(["sh", "-c", options["wrap"]], env={{**environment, **of_array, "SLURM_ARRAY_TASK_ID": str(task)}}, stdout=sys.stderr)
        for task in range(first, last + 1)
    ]
    codes = [task.wait() for task in tasks]
else:
    before = options["dependency"].removeprefix("afterok:")
    is_fine = open(os.path.join(state, before)).read() == "0"
    codes = [subprocess.call(["sh", "-c", options["wrap"]], env=environment, stdout=sys.stderr)] if is_fine else [1]
open(os.path.join(state, job), "w").write(str(max(map(abs, codes))))
print(job + ";cluster" if "parsable" in options else f"Submitted batch job {{job}}")
"""


@pytest.fixture
def tools(tmp_path):
    """An environment with the commands `beamcast` and `sbatch`."""
    folder = tmp_path / "bin"
    folder.mkdir()
    scripts = {"beamcast": f'#!/bin/sh\nexec "{sys.executable}" -m beamcast "$@"\n', "sbatch": SBATCH.format(python=sys.executable)}
    for name, text in scripts.items():
        path = folder / name
        path.write_text(text, "utf-8")
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
    state = tmp_path / "slurm"
    state.mkdir()
    return {**os.environ, "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}", "FAKE_SLURM": str(state)}


def ended(tools):
    """The exit codes of the jobs that were submitted."""
    state = Path(tools["FAKE_SLURM"])
    return [int((state / str(job)).read_text()) for job in range(1, len(list(state.iterdir())) + 1)]


def test_the_page_shows_the_files():
    page = (ROOT / "docs" / "scale.md").read_text("utf-8")
    blocks = re.findall(r"^```(?:sh|yaml)\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    for path in (SLURM, KUBERNETES):
        assert path.read_text("utf-8") in blocks, path.name


def test_the_script_of_slurm_is_clean():
    shellcheck = shutil.which("shellcheck", path=os.path.dirname(sys.executable)) or shutil.which("shellcheck")
    if shellcheck is None and "BEAMCAST_RAY" not in os.environ:
        pytest.skip("there is no shellcheck")
    done = subprocess.run([shellcheck, str(SLURM)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_a_slurm_array_writes_what_one_process_writes(tools, drive_file, whole_drive, tmp_path):
    out = tmp_path / "a folder"
    done = subprocess.run([SLURM, drive_file, out, "3"], env=tools, capture_output=True, text=True)
    assert done.returncode == 0 and ended(tools) == [0, 0], done.stderr
    assert_same(out, whole_drive)


def test_a_task_of_slurm_that_fails_is_gone_on_with(tools, drive_file, whole_drive, tmp_path):
    out = tmp_path / "out"
    # A task that is killed while it writes its part, and one that never began.
    shard = [*COMMAND, "scan", "-q", drive_file, "--out", out, "--resume", "--shard", "auto", "--threads", "1"]
    environment = {**tools, "SLURM_ARRAY_TASK_MIN": "1", "SLURM_ARRAY_TASK_COUNT": "3"}
    subprocess.run(shard, env={**environment, "SLURM_ARRAY_TASK_ID": "1"}, check=True)
    victim = subprocess.Popen(shard, env={**environment, "SLURM_ARRAY_TASK_ID": "2"})
    journal = out / "journal-2-of-3.jsonl"
    while victim.poll() is None and not (journal.exists() and len(journal.read_bytes().splitlines()) > 5):
        time.sleep(0.01)
    victim.kill()
    assert victim.wait() != 0
    merged = subprocess.run([*COMMAND, "merge", out], capture_output=True, text=True)
    assert merged.returncode == 3 and "part 3 of 3" in merged.stderr
    before = {name: content for name, content in files(out).items() if name.endswith((".exr", ".npy"))}
    done = subprocess.run([SLURM, drive_file, out, "3"], env=tools, capture_output=True, text=True)
    assert done.returncode == 0 and ended(tools) == [0, 0], done.stderr
    # No file that has its name is half written.
    assert len(before) > 80 and all(whole_drive[name] == content for name, content in before.items())
    assert_same(out, whole_drive)


def test_what_depends_on_a_failed_array_does_not_run(tools, drive_file, tmp_path):
    done = subprocess.run([SLURM, drive_file.parent / "none.toml", tmp_path / "out", "2"], env=tools, capture_output=True, text=True)
    assert done.returncode == 0 and ended(tools) == [2, 1], done.stderr
    assert not (tmp_path / "out" / "manifest.json").exists()


def test_pods_write_what_one_process_writes(tools, drive_file, whole_drive, tmp_path):
    job, merge = yaml.safe_load_all(KUBERNETES.read_text("utf-8"))
    for one in (job, merge):
        assert (one["apiVersion"], one["kind"]) == ("batch/v1", "Job")
    assert merge["spec"]["template"]["spec"]["restartPolicy"] == "OnFailure"
    assert job["spec"]["completionMode"] == "Indexed"
    parts = job["spec"]["completions"]
    [scan], [then] = (one["spec"]["template"]["spec"]["containers"] for one in (job, merge))
    assert f"auto/{parts}" in scan["command"]
    threads = scan["command"][scan["command"].index("--threads") + 1]
    assert threads == scan["resources"]["requests"]["cpu"]

    # The volume is a folder of this machine.
    (tmp_path / "jobs").symlink_to(drive_file.parent)

    def start(container, **environment):
        command = [word.replace("/data/", f"{tmp_path}/") for word in container["command"]]
        command = ["1" if word == threads else word for word in command]
        return subprocess.Popen(command, env={**tools, **environment}, stderr=subprocess.PIPE, text=True)

    def merged():
        process = start(then)
        return process.communicate()[1], process.returncode

    said, code = merged()
    assert code != 0, "nothing is there to be merged"
    # A job that is wrong is not tried again, whatever else ends a pod.
    [wrong, moved] = job["spec"]["podFailurePolicy"]["rules"]
    assert (wrong["action"], wrong["onExitCodes"]["containerName"], moved["action"]) == ("FailJob", scan["name"], "Ignore")
    pod = start({"command": [word.replace("drive.toml", "none.toml") for word in scan["command"]]}, JOB_COMPLETION_INDEX="0")
    assert "none.toml" in pod.communicate()[1] and pod.returncode in wrong["onExitCodes"]["values"]
    for index in range(parts):
        if index == 1:
            said, code = merged()
            assert code != 0 and "lacks part 2 of 16" in said
        pod = start(scan, JOB_COMPLETION_INDEX=str(index))
        if index == 3:
            # A pod is evicted, and started again.
            time.sleep(0.2)
            pod.kill()
            pod.communicate()
            pod = start(scan, JOB_COMPLETION_INDEX=str(index))
        said = pod.communicate()[1]
        assert pod.returncode == 0, said
    for _ in range(2):
        said, code = merged()
        assert code == 0, said
    assert_same(tmp_path / "drive", whole_drive)
    assert json.loads((tmp_path / "drive" / "manifest.json").read_text())["frames"][0]["count"] == 60
