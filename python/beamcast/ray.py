"""Jobs on a cluster of Ray: `run` writes the folder that `beamcast scan` writes, and `frames` gives frames to the program.

Each node of the cluster has one actor, which reads the job and builds its scene once. The nodes need this package in the same version,
and the job with all its files under the same paths. Ray comes with `pip install 'beamcast[ray]'`, and is imported here alone.
"""

from __future__ import annotations

import contextlib
import functools
import heapq
import itertools
import math
import os
import re
import sys
import tempfile
import time
import warnings
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TextIO

from . import _native, _reports, errors
from ._job import Channels, Frame, Job

try:
    import ray
    from ray.exceptions import ObjectLostError, RayActorError
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy
except ImportError as error:
    raise ImportError("beamcast.ray needs Ray: pip install 'beamcast[ray]'") from error

__all__ = ["Channels", "Progress", "Seen", "Summary", "frames", "run"]

# A part is some frames at least, so that one is cast while those before it are encoded; and merging opens each part's journal twice,
# where a process may have 1024 files open.
_LEAST_FRAMES, _LEAST_PARTS, _MOST_PARTS = 8, 8, 256
# The tasks that an actor has at a time: it does one, and the next is there already.
_DEPTH = 2
# How often new nodes are looked for, and the progress is told.
_EVERY_S = 1.0
# How long a journal may be held by a process that a lost node has left, and how long the cluster may have no node at all.
_PATIENCE_S = 120.0
# How often an actor may die on a node that lives, before it has done anything.
_MOST_DEATHS = 3
# The library's words about a file that another process holds.
_HELD = "another run is writing to this"


@dataclass(frozen=True)
class Progress:
    """How far a run is.

    Attributes:
        frames: The frames that are finished, of all sensors, with those of an earlier run that was stopped.
        of: The frames of the run.
        nodes: The nodes that have the job open.
        seconds: The time since the run began.
        speed: Frames a second of this run.
    """

    frames: int
    of: int
    nodes: int
    seconds: float
    speed: float

    def __str__(self) -> str:
        left = self.of - self.frames
        time_left = f", {math.ceil(left / self.speed)} s left" if self.speed > 0 and left else ""
        nodes = "1 node" if self.nodes == 1 else f"{self.nodes} nodes"
        return f"{self.frames} of {self.of} frames, {nodes}, {self.speed:.1f} frames/s{time_left}"


@dataclass(frozen=True)
class Summary:
    """What a run has done.

    Attributes:
        out: The folder.
        frames: The frames of the run, of all sensors.
        earlier: The frames of these that an earlier run had finished.
        files: The files of frames that this run has written.
        bytes: The bytes of these files.
        seconds: The time that the run took.
        nodes: The frames of the parts that each node has finished, by the nodes' names, without those that were there already.
        shards: The parts that the run was made of.
    """

    out: str
    frames: int
    earlier: int
    files: int
    bytes: int
    seconds: float
    nodes: dict[str, int] = field(default_factory=dict)
    shards: int = 1


class Seen(NamedTuple):
    """What came of a frame: its sensor's name, its number, and what the transform has made of it."""

    sensor: str
    number: int
    value: Any


def run(
    job: Job | str | os.PathLike[str],
    overrides: Mapping[str, Any] | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    frames: range | None = None,
    address: str | None = None,
    cpus: float | None = None,
    shards: int | None = None,
    progress: Callable[[Progress], object] | bool | None = None,
) -> Summary:
    """Runs a job on all nodes of a cluster, and writes the folder that `beamcast scan` writes, byte for byte.

    The frames are parted as `scan --shard` parts them. A node writes a part after the other, and nodes that come while the run goes on
    are given parts too. What a node was at when it was lost, another goes on with. If the run is stopped, by Ctrl-C or an error, the
    journals stay in the folder, and the same call goes on with them. A run that is finished is left as it is.

    Args:
        job: The job, or its path. The nodes read it again, with all its files, from the same paths.
        overrides: With a path, as in `Job`.
        out: The folder, which all nodes and this process share; the job's `output.dir` without it.
        frames: The numbers of the frames, without gaps, such as `range(100, 200)`; all without it.
        address: The cluster's address, as `ray.init` takes it. Without it that of `RAY_ADDRESS`, else a cluster on this machine alone. A
            program that has called `ray.init` stays with that cluster.
        cpus: The CPUs of a node that its actor takes, and the threads that it works on; all of the node's without it. Nodes with fewer
            are left out.
        shards: The number of parts, 1 to 256; without it enough for the nodes to share. A run that goes on keeps its number.
        progress: Called with the progress about once a second; or whether a line of it is shown on stderr, which without it depends on
            whether that is a terminal.

    Raises:
        ConfigError, SceneError, UsageError: The job is wrong, before any node starts anything, or on a node, whose name the message has.
        OutputError: The folder can't be written, or has a run of something else.
        InputError: A node sees other files than this process.
    """
    begun = time.monotonic()
    job = job if isinstance(job, Job) else Job(job, overrides)
    first, end = _range(frames)
    out = os.path.abspath(os.fspath(job._native.output_dir() if out is None else out))
    if os.path.exists(os.path.join(out, "manifest.json")):
        # Nothing is left to do, unless the manifest is of another run, of which the library tells.
        finished = job._native.write_part(out, (first, end), (0, 1))
        return Summary(out, finished[0], finished[1], 0, 0, time.monotonic() - begun)
    counts = [max(0, min(end, job.frame_count(index)) - first) for index in range(len(job.sensors))]
    shards = _shards(out, max(counts), shards)
    job._native.check_part(out, (first, end), (0, shards))
    parts = _Parts(out, (first, end), shards, sum(counts))
    tell = _teller(progress)
    with _connected(address), _mark(out) as mark, _Crew(job, cpus, out=out, mark=mark) as crew:
        told = 0.0
        while not parts.are_done:
            crew.refresh()
            parts.give(crew)
            for part, result, name in crew.wait():
                parts.take(part, result, name)
            if tell is not None and (parts.are_done or time.monotonic() - told >= _EVERY_S):
                told = time.monotonic()
                tell(parts.progress(crew, begun))
    if shards > 1:
        _merge(out)
    seconds = time.monotonic() - begun
    return Summary(out, parts.of, parts.earlier, parts.files, parts.bytes, seconds, parts.nodes, shards)


def frames(
    job: Job | str | os.PathLike[str],
    transform: Callable[[Frame], Any] = Channels("range", "id.semantic"),
    *,
    overrides: Mapping[str, Any] | None = None,
    numbers: Iterable[int] | None = None,
    sensors: Iterable[int | str] | None = None,
    address: str | None = None,
    cpus: float | None = None,
    ahead: int | None = None,
) -> Iterator[Seen]:
    """Casts a job's frames on all nodes of a cluster, and gives what the transform makes of each, in the order of `Job.frames`.

    Nothing is written. A frame whose node is lost is cast by another. Arrays that come back are in Ray's memory, and read-only.

    Args:
        job: The job, or its path. The nodes read it again, with all its files, from the same paths.
        transform: What becomes of a frame, on the node that has cast it; the result goes to this process. `Channels` gives arrays.
        overrides: With a path, as in `Job`.
        numbers: The numbers of the frames; all without it.
        sensors: The sensors, by index or name; all without it.
        address: As in `run`.
        cpus: As in `run`.
        ahead: The most frames that are cast before the program has asked for them, which bounds the memory; four a node without it.

    Raises:
        ConfigError, SceneError, UsageError: The job is wrong, at the call, or on a node, whose name the message has.
        InputError: A node sees other files than this process.
    """
    if ahead is not None and ahead < 1:
        raise errors.UsageError(f"ahead is {ahead}: expected 1 or more frames")
    job = job if isinstance(job, Job) else Job(job, overrides)
    # A generator would tell of a wrong sensor when the first frame is asked for.
    chosen = None if sensors is None else [job._index(sensor) for sensor in sensors]
    return _frames(job, transform, job.frame_keys(numbers, sensors=chosen), address, cpus, ahead)


def _frames(
    job: Job,
    transform: Callable[[Frame], Any],
    keys: Iterator[tuple[int, int]],
    address: str | None,
    cpus: float | None,
    ahead: int | None,
) -> Iterator[Seen]:
    with _connected(address), _Crew(job, cpus, transform=transform) as crew:
        numbered = enumerate(keys)
        waiting: deque[tuple[int, tuple[int, int]]] = deque()
        come: dict[int, Seen] = {}
        next_ = 0
        while True:
            crew.refresh()
            most = ahead if ahead is not None else 2 * _DEPTH * max(1, crew.size)
            room = most - len(waiting) - crew.busy - len(come)
            waiting.extend(itertools.islice(numbered, max(0, room)))
            if not waiting and not crew.busy and not come:
                return
            while waiting and crew.give("cast", waiting[0], waiting[0][1]):
                waiting.popleft()
            for task, result, _ in crew.wait(0.0 if next_ in come else _EVERY_S / 2):
                if result is _LOST:
                    # In the order of the frames, of which the first is waited for.
                    waiting = deque(heapq.merge(waiting, [task]))
                else:
                    come[task[0]] = result
            if next_ in come:
                yield come.pop(next_)
                next_ += 1


class _Lost:
    """Stands for the result of a task whose node was lost."""


_LOST = _Lost()


class _Parts:
    """The parts of a run: those that wait, and what came of the others."""

    def __init__(self, out: str, frames: tuple[int, int], shards: int, of: int) -> None:
        self.out, self.frames, self.shards, self.of = out, frames, shards, of
        self.waiting: list[tuple[float, int]] = [(0.0, index) for index in range(shards)]
        self.left = shards
        self.done = self.earlier = self.files = self.bytes = 0
        self.nodes: dict[str, int] = {}
        self._held: dict[int, float] = {}
        self._lines: dict[int, _Lines] = {}

    @property
    def are_done(self) -> bool:
        return self.left == 0

    def give(self, crew: _Crew) -> None:
        """Gives parts to nodes that have room for some."""
        while self.waiting and self.waiting[0][0] <= time.monotonic():
            _, part = self.waiting[0]
            if not crew.give("write", part, self.frames, (part, self.shards)):
                return
            heapq.heappop(self.waiting)
            if part not in self._lines:
                self._lines[part] = _Lines(self._journal(part))

    def take(self, part: int, result: Any, name: str) -> None:
        """Takes what came of a part."""
        if result is _LOST:
            heapq.heappush(self.waiting, (0.0, part))
            return
        if isinstance(result, errors.Error):
            # A process of a lost node may still be at the part for a moment. Both write the same bytes, and one of them the journal.
            since = self._held.setdefault(part, time.monotonic())
            if _HELD not in result.message or time.monotonic() - since > _PATIENCE_S:
                raise _on_node(result, name)
            heapq.heappush(self.waiting, (time.monotonic() + 1.0, part))
            return
        frames, earlier, files, size = result
        self.left -= 1
        self.done += frames
        # Frames that were there when a node went on with the part are an earlier run's, or a lost node's of this run.
        self.earlier += min(earlier, self._lines.pop(part).before)
        self.files += files
        self.bytes += size
        self.nodes[name] = self.nodes.get(name, 0) + frames - earlier

    def progress(self, crew: _Crew, begun: float) -> Progress:
        """How far the run is, by the parts that are done and the journals of the others."""
        frames = self.done + sum(lines.count() for lines in self._lines.values())
        earlier = self.earlier + sum(lines.before for lines in self._lines.values())
        seconds = time.monotonic() - begun
        speed = (frames - earlier) / seconds if seconds > 0 else 0.0
        return Progress(min(frames, self.of), self.of, crew.size, seconds, max(speed, 0.0))

    def _journal(self, part: int) -> str:
        name = f"journal-{part + 1}-of-{self.shards}.jsonl" if self.shards > 1 else "journal.jsonl"
        return os.path.join(self.out, name)


class _Lines:
    """Counts the frames of a journal, which grows: its first line is none."""

    def __init__(self, path: str) -> None:
        self._path, self._at, self._lines = path, 0, 0
        self.before = self.count()

    def count(self) -> int:
        """The frames that are in it by now."""
        with contextlib.suppress(OSError), open(self._path, "rb") as file:
            if os.fstat(file.fileno()).st_size < self._at:
                self._at = self._lines = 0
            file.seek(self._at)
            while chunk := file.read(1 << 20):
                self._at += len(chunk)
                self._lines += chunk.count(b"\n")
        return max(0, self._lines - 1)


@ray.remote(max_restarts=0, max_task_retries=0)
class _Actor:
    """A node's part of the work: it holds the job with its scene. Errors of beamcast are results, so that they keep their places."""

    def open(
        self,
        inputs: tuple[Any, ...],
        threads: int,
        out: str | None,
        mark: str | None,
        version: str,
        files: list[tuple[str, str]],
        transform: Callable[[Frame], Any] | None,
    ) -> errors.Error | None:
        """Reads the job and builds the scene, and checks that the node sees what the driver sees."""
        path, overrides, allowed_folders, _ = inputs
        self._out, self._transform = out, transform
        if _native.VERSION != version:
            return errors.UsageError(f"it has beamcast {_native.VERSION}, and the driver has {version}: install the same on all nodes")
        if not os.path.exists(path):
            return errors.InputError(f"{path}: is not there; the job and its files must have the same paths on all nodes", file=path)
        if mark is not None and not _appears(mark):
            message = f"{out}: is not the folder that the driver has by this name; all nodes and the driver must share it"
            return errors.OutputError(message, file=out)
        try:
            self._job = Job(path, overrides, allowed_folders=allowed_folders, threads=threads)
            if out is not None:
                _native.start_threads(threads)
        except errors.Error as error:
            return error
        for theirs, ours in itertools.zip_longest(files, self._job._native.inputs()):
            if theirs != ours:
                name = (theirs or ours)[0]
                return errors.InputError(f"{path}: {name} has another content than on the driver's machine", file=path)
        return None

    def write(self, frames: tuple[int, int], shard: tuple[int, int]) -> tuple[int, int, int, int] | errors.Error:
        """Writes a part of the run."""
        try:
            return self._job._native.write_part(self._out, frames, shard)
        except errors.Error as error:
            return error

    def cast(self, key: tuple[int, int]) -> Seen | errors.Error:
        """Casts a frame."""
        number, sensor = key
        try:
            frame = self._job.frame(number, sensor)
        except errors.Error as error:
            return error
        return Seen(frame.sensor, number, self._transform(frame))


def _appears(path: str) -> bool:
    """Whether a file is there, which another machine has just made: file systems over a network may tell of it late."""
    for _ in range(50):
        if os.path.exists(path):
            return True
        time.sleep(0.1)
    return False


class _Member:
    """A node with its actor, and the tasks that the actor has: the first of all is to open the job."""

    def __init__(self, node: str, name: str, actor: Any, opening: Any) -> None:
        self.node, self.name, self.actor, self.since = node, name, actor, time.monotonic()
        self.is_open = False
        self.tasks: dict[Any, Hashable] = {opening: None}


class _Crew:
    """The actors on the nodes of the cluster that Ray is connected to. They end when it is left."""

    def __init__(
        self,
        job: Job,
        cpus: float | None,
        *,
        out: str | None = None,
        mark: str | None = None,
        transform: Callable[[Frame], Any] | None = None,
    ) -> None:
        if cpus is not None and not cpus > 0:
            raise errors.UsageError(f"cpus is {cpus}: expected a number above 0")
        self._cpus = cpus
        self._inputs = job.__reduce__()[1]
        self._known = (out, mark, _native.VERSION, job._native.inputs(), transform)
        self._members: dict[str, _Member] = {}
        self._deaths: dict[str, int] = {}
        self._not_before: dict[str, float] = {}
        self._looked = -math.inf
        self._alive = time.monotonic()
        self._warned: set[str] = set()

    def __enter__(self) -> _Crew:
        return self

    def __exit__(self, *_: object) -> None:
        for member in self._members.values():
            # The journal has its finished frames. Files that it has not finished have no name yet.
            ray.kill(member.actor, no_restart=True)

    @property
    def size(self) -> int:
        """The nodes that have the job open."""
        return sum(member.is_open for member in self._members.values())

    @property
    def busy(self) -> int:
        """The tasks that nodes have."""
        return sum(len(member.tasks) for member in self._members.values() if member.is_open)

    def refresh(self) -> None:
        """Gives each node that is new an actor, now and then."""
        now = time.monotonic()
        if now - self._looked < _EVERY_S:
            return
        self._looked = now
        living = [node for node in ray.nodes() if node["Alive"]]
        sizes = {node["NodeID"]: float(node["Resources"].get("CPU", 0.0)) for node in living}
        least = self._cpus or math.ulp(0.0)
        fit = [node for node in living if sizes[node["NodeID"]] >= least]
        if living and not fit:
            raise errors.UsageError(f"no node has {self._cpus or 'any'} CPUs: they have {', '.join(f'{size:g}' for size in sizes.values())}")
        for node in fit:
            key = node["NodeID"]
            if key not in self._members and self._not_before.get(key, 0.0) <= now:
                self._add(key, f"{node['NodeName']} ({key[:8]})", self._cpus or sizes[key])
        self._alive = now if self._members else self._alive
        if now - self._alive > _PATIENCE_S:
            raise errors.UsageError(f"the cluster has had no node for {_PATIENCE_S:g} s")
        for member in self._members.values():
            if not member.is_open and now - member.since > 30.0 and member.name not in self._warned:
                self._warned.add(member.name)
                warnings.warn(f"node {member.name} has not opened the job in 30 s; are its CPUs free? cpus= asks for fewer", stacklevel=4)

    def _add(self, node: str, name: str, cpus: float) -> None:
        threads = max(1, min(int(cpus), 1024))
        where = NodeAffinitySchedulingStrategy(node, soft=False)
        actor = _Actor.options(num_cpus=cpus, scheduling_strategy=where).remote()
        opening = actor.open.remote(self._inputs, threads, *self._known)
        self._members[node] = _Member(node, name, actor, opening)

    def give(self, method: str, task: Hashable, *arguments: Any) -> bool:
        """Gives a task to the node that has the fewest, or returns False if all have enough."""
        free = [member for member in self._members.values() if member.is_open and len(member.tasks) < _DEPTH]
        if not free:
            return False
        member = min(free, key=lambda member: len(member.tasks))
        member.tasks[getattr(member.actor, method).remote(*arguments)] = task
        return True

    def wait(self, seconds: float = _EVERY_S / 2) -> list[tuple[Any, Any, str]]:
        """Waits so long for a task. Gives each that has come to its end with its result, or `_LOST`, and the node's name."""
        owners = {ref: member for member in self._members.values() for ref in member.tasks}
        if not owners:
            time.sleep(seconds)
            return []
        ready, _ = ray.wait(list(owners), num_returns=1, timeout=seconds)
        found = []
        for ref in ready:
            member = owners[ref]
            try:
                result = ray.get(ref)
            except (RayActorError, ObjectLostError) as error:
                found += self._lose(member, error)
                continue
            task = member.tasks.pop(ref)
            if isinstance(result, errors.Error) and _HELD not in result.message:
                raise _on_node(result, member.name)
            self._deaths.pop(member.node, None)
            if member.is_open:
                found.append((task, result, member.name))
            member.is_open = True
        return found

    def _lose(self, member: _Member, error: Exception) -> list[tuple[Any, Any, str]]:
        """Parts with an actor that has died. What it had is to be done by others, and its node may get another one."""
        del self._members[member.node]
        with contextlib.suppress(Exception):
            ray.kill(member.actor, no_restart=True)
        self._not_before[member.node] = time.monotonic() + 2.0
        deaths = self._deaths[member.node] = self._deaths.get(member.node, 0) + 1
        lives = any(node["Alive"] and node["NodeID"] == member.node for node in ray.nodes())
        if lives and deaths >= _MOST_DEATHS:
            raise errors.Error(f"node {member.name}: its actor has died {deaths} times; is beamcast installed there, and is its memory enough? {error}")
        return [(task, _LOST, member.name) for task in member.tasks.values() if member.is_open]


def _on_node(error: errors.Error, name: str) -> errors.Error:
    """The same error, whose message has the node's name."""
    kept = {key: value for key, value in vars(error).items() if key != "message"}
    return type(error)(f"node {name}: {error.message}", **kept)


def _range(frames: range | None) -> tuple[int, int]:
    """The first of the frames, and the end up to and without which they go."""
    if frames is None:
        return 0, 2**64 - 1
    if not isinstance(frames, range) or frames.step != 1 or frames.start < 0 or not frames:
        raise errors.UsageError(f"frames is {frames!r}: expected a range of frames without gaps, such as range(100, 200)")
    return frames.start, frames.stop


def _shards(out: str, frames: int, asked: int | None) -> int:
    """The number of parts: that of the run that goes on, else the one that is asked for, else what so many frames are worth."""
    if asked is not None and not 1 <= asked <= _MOST_PARTS:
        raise errors.UsageError(f"shards is {asked}: expected 1 to {_MOST_PARTS}")
    names = os.listdir(out) if os.path.isdir(out) else []
    found = {int(match[1]) for name in names if (match := re.fullmatch(r"journal-[0-9]+-of-([0-9]+)\.jsonl", name))}
    if asked is None and len(found) == 1:
        return found.pop()
    return asked or max(1, min(frames, max(_LEAST_PARTS, math.ceil(frames / _LEAST_FRAMES)), _MOST_PARTS))


@contextlib.contextmanager
def _connected(address: str | None) -> Iterator[None]:
    """Connects to a cluster, unless the program has done so."""
    if ray.is_initialized():
        yield
        return
    ray.init(address=address, log_to_driver=False, logging_level="warning")
    try:
        yield
    finally:
        ray.shutdown()


@contextlib.contextmanager
def _mark(out: str) -> Iterator[str]:
    """A file in the folder, by which nodes see that it is the same. Its name is one of those that the next run removes if it stays."""
    try:
        os.makedirs(out, exist_ok=True)
        number, path = tempfile.mkstemp(prefix=".beamcast-", suffix=".tmp", dir=out)
    except OSError as error:
        raise errors.OutputError(f"{out}: can't be written: {error.strerror}", file=out) from error
    os.close(number)
    try:
        yield path
    finally:
        with contextlib.suppress(OSError):
            os.remove(path)


def _merge(out: str) -> None:
    """Makes the parts one, when the last process of a lost node has let go of the folder."""
    for left in range(int(_PATIENCE_S), -1, -1):
        done = _reports._run(["merge", "--json", "--", out])
        if done.returncode == 0:
            return
        if left == 0 or _HELD not in done.stderr:
            raise _reports._error(done)
        time.sleep(1.0)


def _teller(progress: Callable[[Progress], object] | bool | None) -> Callable[[Progress], object] | None:
    """What tells of the progress, if anything does."""
    if callable(progress):
        return progress
    if progress is False or progress is None and not sys.stderr.isatty():
        return None
    return functools.partial(_show, sys.stderr)


def _show(stream: TextIO, progress: Progress) -> None:
    is_done = progress.frames == progress.of
    if stream.isatty():
        stream.write(f"\r\x1b[K{progress}" + ("\n" if is_done else ""))
    else:
        stream.write(f"{progress}\n")
    stream.flush()
