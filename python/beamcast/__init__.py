"""LiDARs and depth cameras against glTF scenes: exact ranges, on the CPU.

- `Scene` casts rays of arrays, with the names, shapes and types of Open3D's RaycastingScene.
- `Job` runs a job's sensors against its scene, and gives the frames as arrays.
- `Sensor` gives the directions of a sensor's beams.
- `beamcast.ray` runs jobs on a cluster of Ray, and `beamcast.torch` has datasets for PyTorch.
- `check` and `diff` hold jobs to their baselines and compare outputs, as the commands of these names do.

Lengths are metres, times seconds and angles radians, unless a name says otherwise. The world is right-handed with z up; a sensor's
frame has x forward, y left and z up; a camera's optical frame has x right, y down and z forward.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from . import _native
from .errors import ConfigError, Error, InputError, OutputError, SceneError, UsageError

if TYPE_CHECKING:
    from ._job import Frame, Job, Sensor
    from ._reports import Report, check, diff
    from ._scene import INVALID_ID, Scene

__version__: str = _native.VERSION

__all__ = [
    "INVALID_ID",
    "ConfigError",
    "Error",
    "Frame",
    "InputError",
    "Job",
    "OutputError",
    "Report",
    "Scene",
    "SceneError",
    "Sensor",
    "UsageError",
    "check",
    "diff",
]

# The modules that need NumPy are imported when they are asked for: the command does without, and starts in half the time.
_PLACES = {
    "Frame": "_job",
    "INVALID_ID": "_scene",
    "Job": "_job",
    "Report": "_reports",
    "Scene": "_scene",
    "Sensor": "_job",
    "check": "_reports",
    "diff": "_reports",
}
# So are those that need more: PyTorch and Ray.
_MODULES = ("ray", "torch")


def __getattr__(name: str) -> object:
    if name in _MODULES:
        return import_module(f".{name}", __name__)
    if name not in _PLACES:
        raise AttributeError(f"module 'beamcast' has no attribute {name!r}")
    value = getattr(import_module(f".{_PLACES[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
