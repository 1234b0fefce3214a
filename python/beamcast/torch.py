"""Datasets for PyTorch, which is imported when they are made."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from . import _job
from ._job import Frame, Job

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

try:
    from torch.utils.data import Dataset, IterableDataset, get_worker_info
except ImportError as error:
    raise ImportError("beamcast.torch needs PyTorch: pip install torch") from error

__all__ = ["Channels", "FrameStream", "Frames"]


class Channels(_job.Channels):
    """A transform that gives the named channels of a frame as arrays, of which a loader makes batches.

    Numbers of 32 bits without a sign (ids, labels, causes) become int64: that is what PyTorch's losses take, and older versions of it have
    no other type for them.
    """

    def __call__(self, frame: Frame) -> dict[str, NDArray[np.generic]]:
        """The channels of a frame by their names."""
        return {name: values.astype("int64") if values.dtype == "uint32" else values for name, values in super().__call__(frame).items()}


class Frames(Dataset[Any]):
    """The frames of a job as a map-style dataset, each cast when it is asked for.

    It is pickled as the job is, so the workers of a loader read the job and its scene themselves. A worker casts on one thread.
    """

    def __init__(
        self,
        job: Job | str | os.PathLike[str],
        transform: Callable[[Frame], Any] = Channels("range", "id.semantic"),
        *,
        overrides: Mapping[str, Any] | None = None,
        numbers: Iterable[int] | None = None,
        sensors: Iterable[int | str] | None = None,
    ) -> None:
        """A dataset of a job's frames.

        Args:
            job: The job, or its path.
            transform: What becomes of a frame.
            overrides: With a path, as in `Job`.
            numbers: The numbers of the frames; all without it.
            sensors: The sensors, by index or name; all without it.
        """
        self.job = job if isinstance(job, Job) else Job(job, overrides)
        self.transform = transform
        self.keys = list(self.job.frame_keys(numbers, sensors=sensors))

    def __len__(self) -> int:
        return len(self.keys)

    def __getitem__(self, index: int) -> Any:
        number, sensor = self.keys[index]
        threads = None if get_worker_info() is None else 1
        return self.transform(self.job.frame(number, sensor, threads=threads))


class FrameStream(IterableDataset[Any]):
    """The same as an iterable dataset. Each worker of a loader casts a part of the frames: none comes twice, and none is missing."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        """Takes what `Frames` takes."""
        self.frames = Frames(*arguments, **options)

    def __iter__(self) -> Iterator[Any]:
        worker = get_worker_info()
        first, step = (0, 1) if worker is None else (worker.id, worker.num_workers)
        for index in range(first, len(self.frames), step):
            yield self.frames[index]
