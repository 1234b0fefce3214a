"""A small network learns to label the pixels of a LiDAR from frames that are cast while it trains: nothing is written to a disk.

    python segmentation.py                 # about a minute of one core
    python segmentation.py --steps 40 --workers 2

Each frame is a street of its own (segmentation.toml draws where the LiDAR, cars and people stand), so no batch comes twice. The network sees
what a LiDAR tells: range, intensity and the direction of the beam. It is held to frames of another seed, before and after, by the mean over the
classes of intersection over union, beside a baseline without a network: the commonest class of each row at each distance.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import torch
from torch import nn

import beamcast
from beamcast.torch import FrameStream

JOB = Path(__file__).with_name("segmentation.toml")
CLASSES = {"road": [1, 10], "pavement": [2, 9], "building": [3], "vegetation": [4], "car": [5], "thing": [6, 7, 8, 11, 12]}
NOTHING = len(CLASSES)  # pixels without a return teach nothing
TRAINING_SEED, HELD_OUT_SEED = 1, 2

OF_LABEL = np.full(256, NOTHING, np.int64)
for number, labels in enumerate(CLASSES.values()):
    OF_LABEL[labels] = number


class Pixels:
    """A transform from a frame to the network's input (5, rows, columns) and the class of each pixel (rows, columns)."""

    def __init__(self, directions):
        self.directions = np.moveaxis(directions, -1, 0).astype(np.float32)

    def __call__(self, frame):
        is_seen = np.isfinite(frame["range"])
        distance = np.where(is_seen, frame["range"], 0)
        # The height below the sensor in tens of metres, and the logarithm of the range, are of the size of 1.
        height = distance * self.directions[2] / 10
        layers = [np.log1p(distance) / 4, height, frame["intensity"], self.directions[2] * 4, is_seen]
        return np.stack(layers).astype(np.float32), OF_LABEL[np.minimum(frame.labels, 255)]


class Around(nn.Module):
    """A convolution of an image whose first column follows its last, with a normalisation and a bend."""

    def __init__(self, inputs, outputs, step=1):
        super().__init__()
        self.filter = nn.Conv2d(inputs, outputs, 3, stride=(1, step))
        self.norm = nn.BatchNorm2d(outputs)

    def forward(self, image):
        image = nn.functional.pad(image, (1, 1, 0, 0), mode="circular")
        return torch.relu(self.norm(self.filter(nn.functional.pad(image, (0, 0, 1, 1)))))


class Labeller(nn.Module):
    """A network of the shape of a U: it looks at coarser and coarser columns, and adds that to the fine ones. 38,000 weights."""

    def __init__(self, inputs=5, width=16):
        super().__init__()
        self.fine = Around(inputs, width)
        self.middle = Around(width, 2 * width, step=2)
        self.coarse = nn.Sequential(Around(2 * width, 2 * width, step=2), Around(2 * width, 2 * width))
        self.join_middle = Around(4 * width, width)
        self.join_fine = Around(2 * width, width)
        self.last = nn.Conv2d(width, len(CLASSES), 1)

    def forward(self, image):
        fine = self.fine(image)
        middle = self.middle(fine)
        wider = nn.functional.interpolate(self.coarse(middle), scale_factor=(1, 2))
        joined = self.join_middle(torch.cat([middle, wider], 1))
        wider = nn.functional.interpolate(joined, scale_factor=(1, 2))
        return self.last(self.join_fine(torch.cat([fine, wider], 1)))


class Commonest:
    """The baseline: the commonest class of the training's pixels in each row, in steps of half a metre of range."""

    BINS = 128

    def __init__(self, rows):
        self.counts = np.zeros((rows, self.BINS, len(CLASSES) + 1))

    def places(self, images):
        """The row and the bin of each pixel of a batch of inputs (n, 5, rows, columns)."""
        distance = np.expm1(images[:, 0].numpy() * 4)
        return np.arange(distance.shape[1])[:, None], np.minimum(distance * 2, self.BINS - 1).astype(int)

    def learn(self, images, classes):
        rows, bins = self.places(images)
        np.add.at(self.counts, (np.broadcast_to(rows, bins.shape), bins, classes.numpy()), 1)

    def __call__(self, images):
        rows, bins = self.places(images)
        return torch.from_numpy(self.counts[..., :NOTHING].argmax(-1)[rows, bins])


def mean_iou(answer, batches):
    """The mean over the classes of intersection over union of the answers' classes (n, rows, columns) with the true ones."""
    both = np.zeros((len(CLASSES), len(CLASSES)))
    for images, classes in batches:
        found, true = answer(images).numpy(), classes.numpy()
        is_seen = true != NOTHING
        np.add.at(both, (true[is_seen], found[is_seen]), 1)
    right = both.diagonal()
    return float(np.mean(right / np.maximum(both.sum(0) + both.sum(1) - right, 1)))


def train(steps=300, batch=4, workers=0, held_out=24, say=print):
    """Trains a network. Returns the mean IoU on held-out frames before and after, and of the baseline."""
    torch.manual_seed(0)
    training = beamcast.Job(JOB, {"seed": TRAINING_SEED})
    pixels = Pixels(training.sensors[0].directions())
    stream = FrameStream(training, pixels, numbers=range(steps * batch))
    loader = torch.utils.data.DataLoader(stream, batch_size=batch, num_workers=workers)
    other = FrameStream(beamcast.Job(JOB, {"seed": HELD_OUT_SEED}), pixels, numbers=range(held_out))
    held = list(torch.utils.data.DataLoader(other, batch_size=batch))

    network, baseline = Labeller(), Commonest(training.sensors[0].shape[0])
    optimizer = torch.optim.Adam(network.parameters(), 5e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, 1e-2, total_steps=steps)

    @torch.no_grad()
    def answer(images):
        network.eval()
        return network(images).argmax(1)

    before, start = mean_iou(answer, held), time.monotonic()
    for step, (images, classes) in enumerate(loader):
        network.train()
        loss = nn.functional.cross_entropy(network(images), classes, ignore_index=NOTHING)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        baseline.learn(images, classes)
        if step % 20 == 0:
            say(f"step {step:4}: loss {loss.item():.3f} after {time.monotonic() - start:.0f} s")
    return before, mean_iou(answer, held), mean_iou(baseline, held)


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--steps", type=int, default=300, help="batches to train on")
    options.add_argument("--workers", type=int, default=0, help="processes that cast frames")
    options = options.parse_args()
    before, after, baseline = train(options.steps, workers=options.workers)
    print(f"mean IoU on held-out streets: {before:.3f} before, {after:.3f} after; {baseline:.3f} by row and range alone")


if __name__ == "__main__":
    main()
