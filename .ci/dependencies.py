"""Holds the dependencies to deny.toml: their licences, their sources, and one version of each.

It reads the same lists as cargo-deny, which the workflow on GitHub runs. It differs in that it needs nothing but Python 3.11
and cargo. Usage: python3 .ci/dependencies.py
"""

import json
import re
import subprocess
import sys
import tomllib
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parent.parent


def dependencies():
    """Every package of the resolved graph but beamcast's own, for all platforms and all features."""
    command = ["cargo", "metadata", "--locked", "--all-features", "--format-version", "1"]
    metadata = json.loads(subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout)
    nodes = {node["id"]: [dep["pkg"] for dep in node["deps"]] for node in metadata["resolve"]["nodes"]}
    own = set(metadata["workspace_members"])
    reached, pending = set(), list(own)
    while pending:
        package = pending.pop()
        if package not in reached:
            reached.add(package)
            pending += nodes[package]
    return [package for package in metadata["packages"] if package["id"] in reached - own]


def is_allowed(licence, allowed):
    """Whether an SPDX expression can be satisfied with licences from `allowed`. `/` is read as the OR that it once was."""
    tokens = re.findall(r"\(|\)|[^\s()]+", licence.replace("/", " OR "))

    def alternatives():
        result = conjunction()
        while tokens and tokens[0] == "OR":
            tokens.pop(0)
            result = conjunction() or result
        return result

    def conjunction():
        result = term()
        while tokens and tokens[0] == "AND":
            tokens.pop(0)
            result = term() and result
        return result

    def term():
        name = tokens.pop(0)
        if name == "(":
            result = alternatives()
            tokens.pop(0)
            return result
        if tokens and tokens[0] == "WITH":
            name = " ".join([name, tokens.pop(0), tokens.pop(0)])
        return name in allowed

    return alternatives()


def problems(packages, deny):
    """A sentence for each rule of deny.toml that the packages break, and for each exception that nothing needs."""
    allowed = set(deny["licenses"]["allow"])
    registries = {f"registry+{url}" for url in deny["sources"]["allow-registry"]}
    skipped = {entry["name"] for entry in deny["bans"]["skip"]}
    versions = defaultdict(set)
    for package in packages:
        name = f"{package['name']} {package['version']}"
        licence = package["license"]
        if not licence:
            yield f"{name} names no licence"
        elif not is_allowed(licence, allowed):
            yield f"{name} has the licence {licence}, which deny.toml does not allow"
        if package["source"] not in registries:
            yield f"{name} comes from {package['source']}, which deny.toml does not allow"
        versions[package["name"]].add(package["version"])
    repeated = {name for name, found in versions.items() if len(found) > 1}
    for name in sorted(repeated - skipped):
        yield f"{name} is compiled in the versions {', '.join(sorted(versions[name]))}"
    for name in sorted(skipped - repeated):
        yield f"deny.toml skips {name}, of which there is one version: take the entry out"


def self_test():
    """The rules on cases whose answers are known, so that a mistake in them is no pass."""
    allowed = {"MIT", "Apache-2.0", "Apache-2.0 WITH LLVM-exception", "Unicode-3.0"}
    cases = {
        "MIT": True,
        "GPL-3.0-only": False,
        "GPL-3.0-only/MIT": True,
        "(MIT OR GPL-3.0-only) AND Unicode-3.0": True,
        "MIT AND GPL-3.0-only": False,
        "GPL-3.0-only AND MIT OR Apache-2.0": True,
        "GPL-3.0-only WITH Classpath-exception-2.0": False,
        "Apache-2.0 WITH LLVM-exception": True,
    }
    for licence, expected in cases.items():
        assert is_allowed(licence, allowed) == expected, licence
    deny = {
        "licenses": {"allow": ["MIT"]},
        "sources": {"allow-registry": ["https://index"]},
        "bans": {"skip": [{"name": "old"}]},
    }
    package = {"name": "a", "version": "1.0.0", "license": "MIT", "source": "registry+https://index"}
    broken = [package, package | {"version": "2.0.0", "license": "GPL-3.0-only", "source": "git+https://elsewhere"}]
    assert len(list(problems(broken, deny))) == 4, list(problems(broken, deny))
    assert not list(problems([package], deny | {"bans": {"skip": []}}))


def main():
    self_test()
    packages = dependencies()
    found = list(problems(packages, tomllib.loads((ROOT / "deny.toml").read_text(encoding="utf-8"))))
    for problem in found:
        print(problem, file=sys.stderr)
    if found:
        sys.exit(1)
    print(f"{len(packages)} dependencies are as deny.toml wants them")


main()
