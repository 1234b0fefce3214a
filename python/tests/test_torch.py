"""The datasets share the frames among workers. A stand-in takes PyTorch's place where that is not installed: the classes that the datasets
derive from have no code of their own that matters here."""

import importlib.util
import pickle
import sys
import types

import numpy as np
import pytest


@pytest.fixture
def datasets(monkeypatch):
    """The module, with a function that says which worker a call is made by."""
    info = [None]
    if importlib.util.find_spec("torch") is None:
        data = types.ModuleType("torch.utils.data")
        data.Dataset = data.IterableDataset = type("Dataset", (), {"__class_getitem__": classmethod(lambda cls, _: cls)})
        data.get_worker_info = lambda: info[0]
        for name, module in (("torch", types.ModuleType("torch")), ("torch.utils", types.ModuleType("torch.utils")), ("torch.utils.data", data)):
            monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, "beamcast.torch", raising=False)
    module = importlib.import_module("beamcast.torch")
    monkeypatch.setattr(module, "get_worker_info", lambda: info[0])

    def work_as(number, of):
        info[0] = None if of == 0 else types.SimpleNamespace(id=number, num_workers=of)

    yield module, work_as
    sys.modules.pop("beamcast.torch", None)


def key(frame):
    return frame.sensor, frame.number


def test_a_map_has_every_frame_once(datasets, job):
    module, _ = datasets
    frames = module.Frames(job, key)
    assert len(frames) == 8
    assert [frames[index] for index in range(8)] == [(frame.sensor, frame.number) for frame in job.frames()]
    with pytest.raises(IndexError):
        frames[8]
    channels = module.Frames(job, sensors=["top"], numbers=range(2))[1]
    assert np.array_equal(channels["range"], job.frame(1, "top")["range"]) and set(channels) == {"range", "id.semantic"}


@pytest.mark.parametrize("workers", [0, 1, 3, 4, 9])
def test_workers_share_a_stream(datasets, job, workers):
    module, work_as = datasets
    stream = module.FrameStream(job, key)
    found = []
    for number in range(max(workers, 1)):
        work_as(number, workers)
        found.append(list(stream))
    assert sorted(sum(found, [])) == sorted((frame.sensor, frame.number) for frame in job.frames())
    assert max(map(len, found)) - min(map(len, found)) <= 1


def test_datasets_go_to_workers(datasets, job):
    module, _ = datasets
    frames = module.Frames(job, numbers=[1])
    again = pickle.loads(pickle.dumps(frames))
    assert again.keys == frames.keys and np.array_equal(again[0]["range"], frames[0]["range"])
