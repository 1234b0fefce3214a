"""Checks that a source distribution holds the crates, and nothing of the workplace. Needs nothing but Python."""

import sys
import tarfile


def main():
    with tarfile.open(sys.argv[1]) as archive:
        names = {name.split("/", 1)[1] for name in archive.getnames() if "/" in name}
    for wanted in ("pyproject.toml", "Cargo.lock", "PKG-INFO", "python/src/lib.rs", "src/lib.rs", "configs/sensors/ouster/os1-128.toml"):
        assert wanted in names, f"{wanted} is missing: {sorted(names)[:40]}"
    assert any(name.endswith("beamcast/_native.pyi") for name in names)
    assert any(name.endswith("beamcast/py.typed") for name in names)
    for name in names:
        assert not any(part in ("target", "__pycache__", ".venv", "out") for part in name.split("/")), name
    print(f"{len(names)} files")


if __name__ == "__main__":
    main()
