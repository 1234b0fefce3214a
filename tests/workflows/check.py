"""Holds .github to what GitHub makes of it, as far as that can be known here: its syntax, the names of the release's archives, and what the
steps of the action do. It also looks at the scripts of .ci. `check.py BEAMCAST` needs the program, actionlint, shellcheck, check-jsonschema and PyYAML."""

import hashlib
import os
import re
import subprocess
import sys
import tarfile
import tempfile
import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
ACTION = ROOT / ".github" / "actions" / "beamcast-check" / "action.yml"
# How a runner calls bash where a step names it as its shell.
BASH = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c"]


def syntax():
    """Jobs, keys, expressions, labels of runners, versions of actions and the scripts of steps are as GitHub wants them."""
    tools = Path(sys.executable).parent
    environment = {**os.environ, "PATH": f"{tools}{os.pathsep}{os.environ['PATH']}"}
    subprocess.run([tools / "actionlint", "-shellcheck", tools / "shellcheck", *WORKFLOWS], check=True, env=environment, cwd=ROOT)
    subprocess.run([tools / "shellcheck", ROOT / ".ci" / "run", ROOT / ".ci" / "cases"], check=True)
    for schema, files in (("vendor.github-workflows", WORKFLOWS), ("vendor.github-actions", [ACTION])):
        subprocess.run([tools / "check-jsonschema", "--quiet", "--builtin-schema", schema, *files], check=True)


def filled(template, values):
    """A template of cargo-binstall with its `{ name }` filled in."""
    return re.sub(r"\{ ?([a-z-]+) ?\}", lambda found: values[found[1]], template)


def archives(scratch):
    """The step that packs a release makes the archive, for each target, that `cargo binstall` looks for, with the program where it looks."""
    package = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))["package"]
    template = package["metadata"]["binstall"]
    release = yaml.safe_load((ROOT / ".github" / "workflows" / "release.yml").read_text("utf-8"))
    job = release["jobs"]["binaries"]
    [pack] = [step["run"] for step in job["steps"] if step.get("name") == "pack"]
    targets = [row["target"] for row in job["strategy"]["matrix"]["include"]]
    assert len(targets) >= 5 and len(set(targets)) == len(targets)
    for target in targets:
        suffix = ".exe" if "windows" in target else ""
        folder = scratch / target
        built = folder / "target" / target / "release"
        built.mkdir(parents=True)
        for name in (f"beamcast{suffix}", "beamcast.d", "beamcast.pdb", "libbeamcast.rlib"):
            (built / name).write_text(f"{name} of {target}")
        for name in ("README.md", "LICENSE-MIT", "LICENSE-APACHE"):
            (folder / name).write_text(name)
        subprocess.run([*BASH, pack], check=True, cwd=folder, env={**os.environ, "TARGET": target}, stdout=subprocess.DEVNULL)
        values = {
            "name": package["name"], "version": package["version"], "target": target, "bin": "beamcast", "binary-ext": suffix,
            "repo": "REPO",
        }
        assert template["pkg-fmt"] == "tgz"
        url = filled(template["pkg-url"], values)
        # `gh release create TAG binaries/*` puts each file at this address, and a tag is v and the version.
        address, archive = url.rsplit("/", 1)
        assert address == f"REPO/releases/download/v{package['version']}", url
        made = sorted(path.name for path in (folder / "dist").iterdir())
        assert made == [archive, f"{archive}.sha256"], (made, archive)
        packed = folder / "dist" / archive
        with tarfile.open(packed) as tar:
            names = sorted(member.name for member in tar.getmembers() if member.isfile())
            inner = f"beamcast-{target}"
            assert names == sorted(f"{inner}/{n}" for n in (f"beamcast{suffix}", "README.md", "LICENSE-MIT", "LICENSE-APACHE")), names
            program = filled(template["bin-dir"], values)
            assert tar.extractfile(program).read().decode() == f"beamcast{suffix} of {target}"
        checksum = (folder / "dist" / f"{archive}.sha256").read_text().split()
        assert checksum == [hashlib.sha256(packed.read_bytes()).hexdigest(), archive], checksum
    assert release[True]["push"]["tags"] == ["v*"]  # YAML takes the key `on` for a flag
    print(f"the archives of {len(targets)} targets are those that cargo binstall looks for")


def run_action(folder, beamcast, inputs):
    """Runs the shell steps of the action as a runner does, with the program in the place of what pip would install. Returns the last exit
    code and what pip was asked for."""
    action = yaml.safe_load(ACTION.read_text("utf-8"))
    values = {name: one.get("default", "") for name, one in action["inputs"].items()}
    assert set(inputs) <= set(values)
    values |= inputs
    tools = folder / "tools"
    tools.mkdir(exist_ok=True)
    (tools / "python").write_text('#!/bin/sh\nprintf "%s\\n" "$@" > "$PIP_ASKED"\n')
    (tools / "beamcast").unlink(missing_ok=True)
    (tools / "beamcast").symlink_to(beamcast)
    (tools / "python").chmod(0o755)
    environment = {
        **os.environ, "PATH": f"{tools}{os.pathsep}{os.environ['PATH']}", "PIP_ASKED": str(folder / "pip.txt"), "GITHUB_ACTIONS": "true",
        "GITHUB_WORKSPACE": str(folder), "GITHUB_STEP_SUMMARY": str(folder / "summary.md"),
    }
    done = None
    for step in action["runs"]["steps"]:
        if "run" not in step:
            assert step["uses"].startswith("actions/setup-python@")
            continue
        assert step["shell"] == "bash" and "${{" not in step["run"], "inputs reach scripts by the environment, where they are no code"
        own = {name: re.sub(r"\$\{\{ *inputs\.(\w+) *\}\}", lambda found: values[found[1]], value) for name, value in step["env"].items()}
        done = subprocess.run([*BASH, step["run"]], cwd=folder, env=environment | own, capture_output=True, text=True)
        if done.returncode:
            break
    return done, (folder / "pip.txt").read_text().splitlines()


def action(scratch, beamcast):
    """The action's steps pass where a job is as it was, fail where it is not, and leave their reports."""
    jobs = scratch / "my jobs"
    jobs.mkdir()
    text = (ROOT / "configs" / "room_vlp16.toml").read_text("utf-8").replace("../scenes", str(ROOT / "scenes"))
    text = text.replace('"sensors/', f'"{ROOT}/configs/sensors/')
    (jobs / "room.toml").write_text(text + '\n[[expect]]\nname = "the room is seen"\nreturns = { at_least = 0.5 }\n', "utf-8")
    done, asked = run_action(jobs, beamcast, {"paths": "room.toml"})
    assert done.returncode == 0, done.stderr + done.stdout
    assert asked == ["-m", "pip", "install", "--quiet", "beamcast"], asked
    assert "<testsuite" in (jobs / "beamcast-report" / "junit.xml").read_text("utf-8")
    assert (jobs / "beamcast-report" / "check.html").stat().st_size > 10_000
    assert "room.toml" in (jobs / "summary.md").read_text("utf-8")

    (jobs / "room.toml").write_text(text + '\n[[expect]]\nname = "little is seen"\nreturns = { at_most = 0.5 }\n', "utf-8")
    wrong, asked = run_action(jobs, beamcast, {"paths": "room.toml", "version": "0.1.0", "report": "my report"})
    # 1 says that an expectation is not met, and neither that the job is wrong (2) nor that it can't be run (3).
    assert wrong.returncode == 1 and asked[-1] == "beamcast==0.1.0", (wrong.returncode, asked)
    # Words of an input are paths, and no commands.
    done, _ = run_action(jobs, beamcast, {"paths": "none.toml $(touch made) ; touch made"})
    assert done.returncode != 0 and not (jobs / "made").exists()
    # The annotation is a line of its own, which GitHub reads.
    assert re.search(r"^::error file=room.toml,.*little is seen", wrong.stdout + wrong.stderr, re.MULTILINE), wrong.stdout + wrong.stderr
    assert (jobs / "my report" / "check.html").exists()
    print("the steps of the action do what they say")


def main():
    beamcast = Path(sys.argv[1]).resolve()
    syntax()
    with tempfile.TemporaryDirectory() as scratch:
        archives(Path(scratch))
        action(Path(scratch), beamcast)


if __name__ == "__main__":
    main()
