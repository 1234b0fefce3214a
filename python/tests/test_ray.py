"""Runs on a cluster of Ray, whose nodes are processes of this machine, give what one process gives."""

import io
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import beamcast
from conftest import COMMAND, assert_same, files

ray = pytest.importorskip("ray")
from ray.cluster_utils import Cluster  # noqa: E402

import beamcast.ray  # noqa: E402


@pytest.fixture(scope="module")
def cluster():
    """A cluster of a head without CPUs and two nodes, to which this process is connected."""
    # The least that Ray takes, for servers with little shared memory.
    memory = {"object_store_memory": 80 << 20}
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False, **memory})
    for _ in range(2):
        cluster.add_node(num_cpus=1, **memory)
    ray.init(address=cluster.address, log_to_driver=False, logging_level="warning")
    cluster.wait_for_nodes()
    yield cluster
    ray.shutdown()
    cluster.shutdown()


def when_open(monkeypatch, nodes):
    """Lets nodes have tasks only when so many have opened the job, however long they take to start. Returns a list that gets the
    largest number of tasks that a node has."""
    give, most, deadline = beamcast.ray._Crew.give, [], time.monotonic() + 150

    def gated(crew, *task):
        given = (crew.size >= nodes or time.monotonic() > deadline) and give(crew, *task)
        most.append(max((len(member.tasks) for member in crew._members.values()), default=0))
        return given

    monkeypatch.setattr(beamcast.ray._Crew, "give", gated)
    # Progress is told so often that no run is over before it is.
    monkeypatch.setattr(beamcast.ray, "_EVERY_S", 0.01)
    return most


def test_two_nodes_write_what_one_process_writes(cluster, job_file, whole, tmp_path, monkeypatch):
    told = []
    most = when_open(monkeypatch, 2)
    summary = beamcast.ray.run(job_file, out=tmp_path / "out", progress=told.append)
    # A node has one part that it writes, and one that waits, however many there are.
    assert max(most) <= 2
    assert_same(tmp_path / "out", whole)
    assert (summary.frames, summary.earlier, summary.shards, summary.out) == (8, 0, 4, str(tmp_path / "out"))
    assert sum(summary.nodes.values()) == 8 and len(summary.nodes) == 2, summary
    of_frames = {name: content for name, content in whole.items() if name.endswith((".npz", ".npy"))}
    assert (summary.files, summary.bytes) == (len(of_frames), sum(map(len, of_frames.values())))
    assert (told[-1].frames, told[-1].of, told[-1].nodes) == (8, 8, 2) and "8 of 8 frames, 2 nodes" in str(told[-1])
    # A finished run is left as it is, and no other run goes there.
    again = beamcast.ray.run(job_file, out=tmp_path / "out")
    assert (again.frames, again.earlier, again.files) == (8, 8, 0)
    with pytest.raises(beamcast.OutputError, match="seed"):
        beamcast.ray.run(job_file, {"seed": 5}, out=tmp_path / "out")
    assert_same(tmp_path / "out", whole)


def test_frames_and_parts_can_be_chosen(cluster, job_file, tmp_path):
    subprocess.run([*COMMAND, "scan", "-q", str(job_file), "--frames", "1..3", "--seed", "9", "--out", str(tmp_path / "one")], check=True)
    summary = beamcast.ray.run(job_file, {"seed": 9}, frames=range(1, 3), out=tmp_path / "out", shards=1, cpus=0.5)
    assert summary.frames == 4 and summary.shards == 1
    assert_same(tmp_path / "out", files(tmp_path / "one"))


def test_a_node_is_lost_and_another_comes(cluster, drive_file, whole_drive, tmp_path, monkeypatch):
    when_open(monkeypatch, 3)
    extra = cluster.add_node(num_cpus=1, object_store_memory=80 << 20)
    came = []

    def change(progress):
        if extra in cluster.list_all_nodes():
            if progress.frames >= 15 and progress.nodes == 3:
                # Its processes die at whatever they are at.
                cluster.remove_node(extra, allow_graceful=False)
        elif not came:
            came.append(cluster.add_node(num_cpus=1, object_store_memory=80 << 20))

    summary = beamcast.ray.run(drive_file, out=tmp_path / "out", shards=60, progress=change)
    assert extra not in cluster.list_all_nodes() and came
    assert any(came[0].node_id[:8] in name for name in summary.nodes), summary
    # Frames of a part that the lost node had begun are counted for nobody.
    assert len(summary.nodes) >= 3 and sum(summary.nodes.values()) <= summary.frames == 120
    assert_same(tmp_path / "out", whole_drive)
    verified = subprocess.run([*COMMAND, "verify", str(tmp_path / "out")], capture_output=True, text=True)
    assert verified.returncode == 0, verified.stdout + verified.stderr
    cluster.remove_node(came[0])


DRIVER = """
import pathlib, sys, time
import beamcast.ray as r

path, out, address, frames, mark = sys.argv[1:]
r._EVERY_S = 0.01

def progress(now):
    if now.frames >= int(frames):
        pathlib.Path(mark).touch()
        time.sleep(600)

r.run(path, out=out, address=address, shards=60, progress=progress)
"""


def stopped(cluster, path, out, frames, number):
    """Runs a job by a process of its own, and sends that a signal when so many frames are finished. Returns what it has said."""
    mark = out.with_name(f"at-{frames}")
    process = subprocess.Popen([sys.executable, "-c", DRIVER, path, out, cluster.address, str(frames), mark], stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120
    while not mark.exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(number)
    _, said = process.communicate(timeout=120)
    assert mark.exists() and process.returncode != 0, said
    return said


def test_a_run_that_is_stopped_goes_on_later(cluster, drive_file, whole_drive, tmp_path):
    out = tmp_path / "out"
    # The driver has no time to end anything, and its nodes end with it.
    stopped(cluster, drive_file, out, 10, signal.SIGKILL)
    assert list(out.glob("journal-*-of-60.jsonl"))
    assert "KeyboardInterrupt" in stopped(cluster, drive_file, out, 50, signal.SIGINT)
    assert not (out / "manifest.json").exists()
    summary = beamcast.ray.run(drive_file, out=out)
    # The number of parts is that of the journals.
    assert summary.shards == 60 and 50 <= summary.earlier < 120 and sum(summary.nodes.values()) == 120 - summary.earlier
    assert_same(out, whole_drive)


def test_frames_come_back_in_order_and_not_too_many(cluster, job_file, tmp_path):
    job = beamcast.Job(job_file, {"sequence.frames": 12})
    expected = list(job.frames())

    def note(frame):
        Path(tmp_path, f"{frame.sensor}-{frame.number}").touch()
        return frame["range_m"], frame.causes

    came = beamcast.ray.frames(job, note, ahead=5)
    for index, frame in enumerate(expected):
        seen = next(came)
        assert (seen.sensor, seen.number) == (frame.sensor, frame.number)
        assert np.array_equal(seen.value[0], frame["range_m"]) and np.array_equal(seen.value[1], frame.causes)
        if index in (0, 9):
            time.sleep(1.0)
        # The frames that the program has, and at most five more.
        assert len(list(tmp_path.iterdir())) <= index + 1 + 5
    with pytest.raises(StopIteration):
        next(came)


def test_a_frame_whose_process_dies_is_cast_again(cluster, job_file, tmp_path):
    def die_once(frame):
        mark = tmp_path / "died"
        if frame.number == 2 and not mark.exists():
            mark.touch()
            os._exit(1)
        return frame.number

    seen = list(beamcast.ray.frames(job_file, die_once, sensors=["top"]))
    assert (tmp_path / "died").exists() and [one.value for one in seen] == [0, 1, 2, 3]


def test_errors_of_nodes_say_where(cluster, job_file, tmp_path, monkeypatch):
    path = job_file.parent / "changing.toml"
    text = job_file.read_text("utf-8")
    path.write_text(text, "utf-8")
    job = beamcast.Job(path)
    path.write_text(text.replace("max_m = 60.0", "maxm = 60.0", 1), "utf-8")
    with pytest.raises(beamcast.ConfigError, match=r"^node \S+ \(\w{8}\): ") as caught:
        beamcast.ray.run(job, out=tmp_path / "out")
    line = next(number for number, line in enumerate(path.read_text().splitlines(), 1) if "maxm" in line)
    assert (caught.value.file, caught.value.line) == (str(path), line) and "max_m" in caught.value.message
    path.write_text(text.replace("max_m = 60.0", "max_m = 50.0", 1), "utf-8")
    with pytest.raises(beamcast.InputError, match="changing.toml has another content than on the driver's machine"):
        beamcast.ray.run(job, out=tmp_path / "out")
    path.unlink()
    with pytest.raises(beamcast.InputError, match=r"node .*changing\.toml: is not there") as caught:
        list(beamcast.ray.frames(job))
    assert caught.value.file == str(path)
    # Nothing is left of a run that has not begun.
    assert files(tmp_path / "out") == {}

    import contextlib

    monkeypatch.setattr(beamcast.ray, "_mark", lambda out: contextlib.nullcontext(str(tmp_path / "elsewhere")))
    with pytest.raises(beamcast.OutputError, match="is not the folder that the driver has by this name"):
        beamcast.ray.run(job_file, out=tmp_path / "out")


def test_what_the_driver_finds_wrong_starts_no_node(job_file, tmp_path, monkeypatch):
    monkeypatch.setattr(beamcast.ray.ray, "init", lambda **_: pytest.fail("it connects"))
    monkeypatch.setattr(beamcast.ray.ray, "is_initialized", lambda: False)
    with pytest.raises(beamcast.ConfigError) as caught:
        beamcast.ray.run(job_file, {"sensor.top.range.max_m": "far"}, out=tmp_path / "out")
    assert caught.value.key == "max_m"
    for options in ({"shards": 0}, {"shards": 257}, {"frames": range(0, 9, 2)}, {"frames": range(4, 9)}):
        with pytest.raises(beamcast.UsageError):
            beamcast.ray.run(job_file, out=tmp_path / "out", **options)
    with pytest.raises(beamcast.UsageError, match="mcap"):
        beamcast.ray.run(job_file, {"output.formats": ["mcap"]}, out=tmp_path / "out")
    with pytest.raises(IndexError):
        beamcast.ray.frames(job_file, sensors=[7])
    with pytest.raises(beamcast.UsageError):
        beamcast.ray.frames(job_file, ahead=0)


def test_too_many_cpus_are_told(cluster, job_file, tmp_path):
    with pytest.raises(beamcast.UsageError, match="no node has 64 CPUs: they have"):
        beamcast.ray.run(job_file, out=tmp_path / "out", cpus=64)


@pytest.mark.parametrize(("is_terminal", "shown"), [(True, "\r\x1b[K{}\r\x1b[K{}\n"), (False, "{}\n{}\n")])
def test_a_line_shows_the_progress(is_terminal, shown):
    stream = io.StringIO()
    stream.isatty = lambda: is_terminal
    first, last = (beamcast.ray.Progress(frames, 9, 1, 2.0, 1.5) for frames in (3, 9))
    assert str(first) == "3 of 9 frames, 1 node, 1.5 frames/s, 4 s left" and str(last) == "9 of 9 frames, 1 node, 1.5 frames/s"
    for progress in (first, last):
        beamcast.ray._show(stream, progress)
    assert stream.getvalue() == shown.format(first, last)


@pytest.mark.parametrize(("frames", "parts"), [(1, 1), (6, 6), (20, 8), (100, 13), (1000, 125), (1_000_000, 256)])
def test_parts_are_neither_too_few_nor_too_many(tmp_path, frames, parts):
    assert beamcast.ray._shards(str(tmp_path), frames, None) == parts


def test_without_ray_only_the_module_fails():
    program = (
        "import sys; sys.modules['ray'] = None\nimport beamcast\nbeamcast.Sensor.presets()\n"
        "try: beamcast.ray\nexcept ImportError as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "beamcast.ray needs Ray: pip install 'beamcast[ray]'"
