"""The datasets in PyTorch's own loaders, and the example that trains. `python3 -m pytest python/tests/test_torch_loaders.py` needs PyTorch; .ci/run has
that of Debian, which is for CPUs alone."""

import importlib
import re
import subprocess
import sys

import numpy as np
import pytest
from conftest import ROOT

torch = pytest.importorskip("torch")


@pytest.fixture
def module():
    """The module as it is imported by others: test_torch.py takes it out of the list of modules."""
    return importlib.import_module("beamcast.torch")


def key(frame):
    return frame.sensor, frame.number


def loaded(dataset, workers, start=None, sampler=None):
    """The frames that a loader gives, in its order."""
    loader = torch.utils.data.DataLoader(dataset, batch_size=3, num_workers=workers, multiprocessing_context=start, collate_fn=list, sampler=sampler)
    return [one for batch in loader for one in batch]


@pytest.mark.parametrize(("workers", "start"), [(0, None), (1, "fork"), (4, "fork"), (1, "spawn"), (4, "spawn")])
def test_loaders_give_every_frame_once(module, job, workers, start):
    expected = [key(frame) for frame in job.frames()]
    assert len(set(expected)) == 8
    # A map-style dataset keeps its order whoever casts; of a stream each worker gives its own part.
    assert loaded(module.Frames(job, key), workers, start) == expected
    found = loaded(module.FrameStream(job, key), workers, start)
    assert sorted(found) == sorted(expected) and (workers > 1 or found == expected)


@pytest.mark.parametrize("start", ["fork", "spawn"])
def test_workers_cast_the_same_frames(module, job, start):
    loader = torch.utils.data.DataLoader(
        module.Frames(job, module.Channels("range", "id.semantic", "cause"), sensors=["top"]), batch_size=2, num_workers=2, multiprocessing_context=start,
    )
    batches = list(loader)
    for name, kind in (("range", torch.float32), ("id.semantic", torch.int64), ("cause", torch.int64)):
        joined = torch.cat([batch[name] for batch in batches])
        assert joined.dtype == kind
        assert np.array_equal(joined.numpy(), np.stack([frame[name] for frame in job.frames(sensors=["top"])]))


@pytest.mark.parametrize("workers", [0, 2])
def test_shards_share_the_frames(module, job, workers):
    expected = sorted(key(frame) for frame in job.frames())
    of_numbers = [loaded(module.FrameStream(job, key, numbers=range(part, 4, 3)), workers) for part in range(3)]
    assert sorted(sum(of_numbers, [])) == expected and all(of_numbers)
    frames = module.Frames(job, key)
    samplers = [torch.utils.data.distributed.DistributedSampler(frames, num_replicas=2, rank=rank) for rank in range(2)]
    of_ranks = [loaded(frames, workers, sampler=sampler) for sampler in samplers]
    assert sorted(sum(of_ranks, [])) == expected and len(of_ranks[0]) == len(of_ranks[1]) == 4
    shuffled = loaded(frames, workers, sampler=torch.utils.data.RandomSampler(frames))
    assert sorted(shuffled) == expected


@pytest.mark.skipif(sys.platform != "linux", reason="forks")
def test_a_loader_goes_on_after_frames_were_cast_before_it_forked(module, job):
    job.frame(0, "top", threads=2)
    assert len(loaded(module.Frames(job, key), 2, "fork")) == 8
    assert job.frame(0, "top", threads=2)["range"].shape == (16, 180)


def test_tensors_share_the_memory(job):
    frame = job.frame(0, "top")
    for array in (frame["range"], frame["range_m"], frame["intensity"], frame.points(), frame.range_jacobian(), frame.returns["normal"]):
        tensor = torch.from_dlpack(array)
        assert tensor.data_ptr() == array.ctypes.data and tuple(tensor.shape) == array.shape
    shared = torch.from_dlpack(frame["intensity"])
    shared[0, 0] = 0.25
    assert frame["intensity"][0, 0] == 0.25


def test_the_page_says_what_works(tmp_path, monkeypatch):
    for folder in ("configs", "scenes"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs" / "python.md").read_text("utf-8")
    blocks = [block for block in re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL) if "# needs: torch" in block]
    assert blocks
    # Of its own, as readers run them: a worker that is spawned can't find what `exec` has.
    for block in blocks:
        subprocess.run([sys.executable, "-c", block], check=True)


def test_a_network_learns(examples):
    import segmentation

    lines = []
    before, after, baseline = segmentation.train(steps=STEPS, held_out=8, say=lines.append)
    print(f"mean IoU: {before:.3f} before, {after:.3f} after, {baseline:.3f} by row and range")
    assert lines and before < 0.2
    # A network that learns nothing keeps to the commonest class, whose IoU is below 0.5: less than 0.1 of the mean. The baseline knows where the
    # ground and the walls are; what it lacks is context, which is all that the network can gain.
    assert after > before + 0.2 and after > baseline


STEPS = 40
