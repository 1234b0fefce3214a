"""Jobs, their sensors, and their frames."""

from __future__ import annotations

import heapq
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._native import NativeFrame, NativeJob, NativeSensor


class Sensor:
    """A LiDAR or a camera: where its beams go, and when.

    `Sensor("sensors/my.toml")` reads a sensor file, `Sensor.preset("ouster/os1-128")` takes a built-in one, and `job.sensors` are
    those of a job.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Reads a sensor file.

        Raises:
            ConfigError: The file is wrong.
        """
        self._native: NativeSensor = NativeSensor.of_file(path)

    @classmethod
    def _of(cls, native: NativeSensor) -> Sensor:
        sensor = cls.__new__(cls)
        sensor._native = native
        return sensor

    @classmethod
    def preset(cls, name: str) -> Sensor:
        """A built-in sensor by its name.

        Raises:
            ConfigError: There is none of that name.
        """
        return cls._of(NativeSensor.preset(name))

    @staticmethod
    def presets() -> list[str]:
        """The names of the built-in sensors."""
        return _native.preset_names()

    @property
    def name(self) -> str:
        """The name: of a preset, of the file, or in the job."""
        return self._native.name

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the image: a LiDAR has a row a beam, the highest first, and a column a firing."""
        return self._native.rows, self._native.columns

    @property
    def is_camera(self) -> bool:
        """Whether the sensor is a camera, which has a planar depth `Z`."""
        return self._native.is_camera

    @property
    def pattern(self) -> str:
        """The name of the pattern's table, such as `rotating`."""
        return self._native.pattern

    @property
    def rate_hz(self) -> float | None:
        """Frames a second, or None."""
        return self._native.rate_hz

    @property
    def limits_m(self) -> tuple[float, float]:
        """The least and the largest range (of some cameras: depth) that the sensor reports, in metres."""
        return self._native.limits[:2]

    def directions(self, frame: int = 0) -> NDArray[np.float64]:
        """The unit directions (rows, columns, 3) of a frame's beams in the sensor's frame (x forward). NaN where a pixel has none."""
        return self._pulses("directions", frame, 3)

    def origins(self, frame: int = 0) -> NDArray[np.float64]:
        """The points (rows, columns, 3) that a frame's beams start at, in the sensor's frame, in metres. NaN where a pixel has none."""
        return self._pulses("origins", frame, 3)

    def times_s(self, frame: int = 0) -> NDArray[np.float64]:
        """The times (rows, columns) of a frame's beams from the frame's start, in seconds. NaN where a pixel has none."""
        return self._pulses("times_s", frame, 1)

    def rays(self, world_from_sensor: Any = None, frame: int = 0) -> NDArray[np.float64]:
        """The rays (rows, columns, 6) of a frame's beams, as `Scene.cast_rays` takes them.

        Args:
            world_from_sensor: The sensor's pose, a matrix (4, 4); at the world's origin without it.
            frame: The number of the frame, which matters where the pattern does not repeat.
        """
        pulses = self._native.pulses(frame, None)
        origins, directions = (pulses[name].reshape(*self.shape, 3) for name in ("origins", "directions"))
        if world_from_sensor is not None:
            pose = np.asarray(world_from_sensor, np.float64)
            origins, directions = origins @ pose[:3, :3].T + pose[:3, 3], directions @ pose[:3, :3].T
        return np.concatenate([origins, directions], axis=-1)

    def _pulses(self, name: str, frame: int, each: int) -> NDArray[np.float64]:
        values = self._native.pulses(frame, None)[name]
        return values.reshape(*self.shape, each) if each > 1 else values.reshape(self.shape)

    def __repr__(self) -> str:
        rows, columns = self.shape
        return f"<beamcast.Sensor {self.name!r}: {self.pattern}, {rows} × {columns}>"


class Frame:
    """What a sensor of a job saw in one turn or one image.

    `frame["range_m"]` is the exact range (rows, columns) in float64; `frame["range"]`, `frame["intensity"]`, `frame["cause"]` and
    all of `frame.keys()` are the channels of files (docs/formats.md), float32 or uint32. Where a pixel has no return, ranges and depths
    are inf and all else is 0, but for the cause. An array is made when it is first asked for and handed over without a copy; asked for
    again, it is the same one. `torch.from_dlpack(frame["range"])` shares its memory.
    """

    def __init__(self, native: NativeFrame) -> None:
        """Frames come from `Job.frames` and `Job.frame`."""
        self._native = native
        self._made: dict[tuple[str, int], NDArray[Any]] = {}
        self._returns: dict[str, NDArray[Any]] | None = None
        self._boxes: list[dict[str, Any]] | None = None

    @property
    def sensor(self) -> str:
        """The sensor's name in the job."""
        return self._native.sensor

    @property
    def number(self) -> int:
        """The frame's number, from 0."""
        return self._native.number

    @property
    def start_s(self) -> float:
        """The time at which the frame starts, in seconds."""
        return self._native.start_s

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self._native.rows, self._native.columns

    @property
    def world_from_sensor(self) -> NDArray[np.float64]:
        """The pose (4, 4) of the sensor (x forward) in the world when the frame started."""
        return np.array(self._native.world_from_sensor())

    def keys(self) -> list[str]:
        """The names of the channels."""
        return ["range_m", *self._native.channel_names()]

    def __iter__(self) -> Iterator[str]:
        return iter(self.keys())

    def __contains__(self, name: object) -> bool:
        return name in self.keys()

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.channel(name)

    def channel(self, name: str, number: int = 0) -> NDArray[Any]:
        """A channel (rows, columns) of each pixel's return of this number, from 0. A pixel with fewer returns is as one without.

        Raises:
            KeyError: The frame has no such channel; the message lists those that it has.
        """
        known = self._made.get((name, number))
        if known is not None:
            return known
        flat = self._native.range_m(number) if name == "range_m" else self._native.channel(name, number)
        made = self._made[name, number] = flat.reshape(self.shape)
        return made

    def range_jacobian(self, number: int = 0) -> NDArray[np.float64]:
        """The derivative (rows, columns, 6) of the ideal range of each pixel's return of this number by the pose of the sensor.

        The sensor is moved in its own frame: each beam's world_from_sensor(t), at the beam's own time t, becomes
        world_from_sensor(t)·exp(ξ). ξ is a translation τ in metres along the axes x (forward), y (left) and z (up) of the sensor's
        frame, and a rotation vector φ in radians about the same axes through its origin; a camera has these axes, too, and not those
        of its optical frame. A wrong mount does this to all beams of a frame alike, whether the sensor moves or not: the pose on the
        body, body_from_sensor, becomes body_from_sensor·exp(ξ).

        The columns are ∂r/∂τx, ∂r/∂τy, ∂r/∂τz, without a unit, and ∂r/∂φx, ∂r/∂φy, ∂r/∂φz in metres a radian:
        ∂r/∂τ = −n / (n·d) and ∂r/∂φ = −(p × n) / (n·d), with the unit direction d of the beam, the point p that it meets and the normal
        n of the triangle there, in the sensor's frame and float64. Where a sensor's ranges are distances from its origin and not
        lengths of beams (Hesai's), they are p·d / |p| of that. The triangle stays where it is at the beam's time, and the derivative
        holds as long as the beam stays on it.

        NaN where there is no return; where a return does not come straight off one surface (`cause` is not "surface"); and where the
        beam grazes its triangle, with |n·d| below 1e-6: it leaves any triangle before the derivative holds. Of a sensor that measures
        it is the derivative of the range of the pulse's axis on the return's triangle, without the sensor's errors.
        """
        return self._native.range_jacobian(number).reshape(*self.shape, 6)

    @property
    def returns(self) -> dict[str, NDArray[Any]]:
        """All returns, row by row of the image, as columns of one length n: `row`, `column`, `return` (its number in its pixel),
        `instance`, `label`, `triangle`, `cause` uint32, `range_m` float64, `intensity` float32, and `normal` float32 (n, 3), towards
        the sensor, in the sensor's frame (x forward). Ids count from 1; 0 is none."""
        if self._returns is None:
            self._returns = self._native.returns()
        return self._returns

    def points(self, frame: str = "sensor", time: str = "raw") -> NDArray[np.float64]:
        """The points (n, 3) of the returns in metres, in the order of `returns`.

        Args:
            frame: "sensor" (of a camera: its optical frame), "body" or "world".
            time: The time whose frame that is, where the sensor moves: "raw" is each point's own, "start", "middle" and "end" are the
                frame's. Points in the world need none.
        """
        return self._native.points(frame, time)[0].reshape(-1, 3)

    def point_times_s(self) -> NDArray[np.float64]:
        """The times (n,) of the returns from the frame's start, in seconds, in the order of `returns`."""
        return self._native.points("sensor", "raw")[1]

    @property
    def causes(self) -> NDArray[np.uint32]:
        """Why each pixel (rows, columns) has no return, or what its first return is of. `Frame.cause_names` has the words."""
        return self["cause"]

    @staticmethod
    def cause_names() -> list[str]:
        """The words that the numbers of causes stand for."""
        return NativeFrame.cause_names()

    @property
    def labels(self) -> NDArray[np.uint32]:
        """The semantic label of each pixel's (rows, columns) first return; 0 is none."""
        return self["id.semantic"]

    @property
    def instances(self) -> NDArray[np.uint32]:
        """The object of each pixel's (rows, columns) first return, from 1; 0 is none. `Job.object_names` has the names."""
        return self["id.instance"]

    @property
    def boxes(self) -> list[dict[str, Any]]:
        """The boxes of objects, with the keys of boxes.jsonl (docs/ground-truth.md). Empty unless the job has `[truth] boxes`."""
        if self._boxes is None:
            self._boxes = [json.loads(line) for line in self._native.boxes()]
        return self._boxes

    def __repr__(self) -> str:
        rows, columns = self.shape
        returns = self._native.return_count
        return f"<beamcast.Frame {self.sensor}/{self.number:06}: {rows} × {columns}, {returns} returns>"


class Channels:
    """A transform that gives the named channels of a frame as arrays, which go to another process or into a batch."""

    def __init__(self, *names: str) -> None:
        """Takes the names of channels, as `Frame.keys` lists them."""
        self.names = names

    def __call__(self, frame: Frame) -> dict[str, NDArray[np.generic]]:
        """The channels of a frame by their names."""
        return {name: frame[name] for name in self.names}


class Job:
    """A job: a rig of sensors, a scene, and a sequence of frames.

    The scene is read and built once. A frame depends on the job, the overrides and its own number alone, so processes can share the
    frames of a job among them: a job is pickled as its path and its overrides, and read again where it is unpickled.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        overrides: Mapping[str, Any] | None = None,
        *,
        allowed_folders: Iterable[str | os.PathLike[str]] = (),
        threads: int | None = None,
    ) -> None:
        """Reads a job and its scene.

        Args:
            path: The job's file.
            overrides: Keys that win over the file's, as `--set` has them: `{"seed": 3, "sensor.top.range.max_m": 50.0}`.
            allowed_folders: Folders besides the scene's own that its buffers may lie in.
            threads: The threads to read and build with, and to cast with unless a call says otherwise; None or 0 for one a core.

        Raises:
            ConfigError: The job or a sensor file is wrong; the exception has its file, line, key and message.
            SceneError: The scene can't be read.
            UsageError: A frame does not fit into the machine's memory.
        """
        self._path = os.path.abspath(os.fspath(path))
        self._overrides = dict(overrides or {})
        self._allowed_folders = [os.path.abspath(os.fspath(folder)) for folder in allowed_folders]
        self._threads = threads
        pairs = [f"{key}={_toml(value)}" for key, value in self._overrides.items()]
        self._native = NativeJob(path, pairs, self._allowed_folders, threads)
        self._sensors = [Sensor._of(native) for native in self._native.sensors()]

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (self._path, self._overrides, self._allowed_folders, self._threads)

    @property
    def path(self) -> str:
        """The job's file, as an absolute path."""
        return self._path

    @property
    def sensors(self) -> list[Sensor]:
        """The sensors of the rig, in the job's order."""
        return list(self._sensors)

    @property
    def warnings(self) -> list[dict[str, Any]]:
        """What is probably not meant in the job or its scene, each with `file`, `line`, `key`, `message`, `help` and `code`."""
        return self._native.warnings()

    @property
    def resolved(self) -> dict[str, Any]:
        """The keys of the job with its sensors' files merged in, without defaults."""
        resolved: dict[str, Any] = json.loads(self._native.resolved())
        return resolved

    @property
    def label_names(self) -> dict[int, str]:
        """The names of labels."""
        return self._native.label_names()

    @property
    def object_names(self) -> list[str]:
        """The names of the scene's objects: id 1 is the first."""
        return self._native.object_names()

    def frame_count(self, sensor: int | str = 0) -> int:
        """The number of frames of a sensor, by its index or its name."""
        return self._native.frames_of(self._index(sensor))

    def frame(self, number: int = 0, sensor: int | str = 0, *, threads: int | None = None) -> Frame:
        """Casts a frame of a sensor.

        Args:
            number: The frame's number, from 0.
            sensor: The sensor's index or name.
            threads: The threads to cast on; the frame does not depend on it.

        Raises:
            IndexError: The sensor has no such frame.
        """
        index = self._index(sensor)
        if number < 0:
            raise IndexError(f"there is no frame {number}")
        return Frame(self._native.cast(index, number, self._threads if threads is None else threads))

    def frames(
        self,
        numbers: Iterable[int] | None = None,
        *,
        sensors: Iterable[int | str] | None = None,
        threads: int | None = None,
    ) -> Iterator[Frame]:
        """Casts frames, one when it is asked for, in the order of the times at which they start.

        Args:
            numbers: The numbers of the frames, such as `range(10)`; all without it. Those that a sensor does not have are left out.
            sensors: The sensors, by index or name; all without it.
            threads: The threads to cast on.
        """
        for number, sensor in self.frame_keys(numbers, sensors=sensors):
            yield self.frame(number, sensor, threads=threads)

    def frame_keys(
        self, numbers: Iterable[int] | None = None, *, sensors: Iterable[int | str] | None = None
    ) -> Iterator[tuple[int, int]]:
        """The (number, sensor index) of the frames that `frames` casts, in its order."""
        chosen = range(len(self._sensors)) if sensors is None else sorted({self._index(s) for s in sensors})
        if numbers is not None:
            numbers = sorted(set(numbers)) if not isinstance(numbers, range) or numbers.step < 0 else numbers

        def of_sensor(sensor: int) -> Iterator[tuple[float, int, int]]:
            count = self._native.frames_of(sensor)
            for number in range(count) if numbers is None else numbers:
                if 0 <= number < count:
                    yield self._native.start_s(sensor, number), sensor, number

        for _, sensor, number in heapq.merge(*map(of_sensor, chosen)):
            yield number, sensor

    def _index(self, sensor: int | str) -> int:
        if isinstance(sensor, str):
            names = [one.name for one in self._sensors]
            if sensor not in names:
                raise KeyError(f"the job has no sensor {sensor!r}: it has {', '.join(names)}")
            return names.index(sensor)
        if not 0 <= sensor < len(self._sensors):
            raise IndexError(f"there is no sensor {sensor}: the job has {len(self._sensors)}")
        return sensor

    def __repr__(self) -> str:
        return f"<beamcast.Job {self._path!r}: {', '.join(sensor.name for sensor in self._sensors)}>"


def _unpickled(path: str, overrides: dict[str, Any], allowed_folders: list[str], threads: int | None) -> Job:
    return Job(path, overrides, allowed_folders=allowed_folders, threads=threads)


def _toml(value: Any) -> str:
    """A value as TOML writes it."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))  # inf and nan are TOML's words, too
    if isinstance(value, (str, os.PathLike)):
        # The escapes of JSON are TOML's, but for pairs of surrogates and one control character.
        return json.dumps(os.fspath(value), ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        pairs = (f"{json.dumps(str(key), ensure_ascii=False)} = {_toml(one)}" for key, one in value.items())
        return "{ " + ", ".join(pairs) + " }"
    if isinstance(value, (Iterable, np.ndarray)):
        return "[" + ", ".join(_toml(one) for one in value) + "]"
    raise TypeError(f"{value!r} is no value of a job: expected a number, a text, a list or a dict")
