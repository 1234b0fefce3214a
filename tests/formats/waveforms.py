"""Waveforms are added up with NumPy, and have their peaks where the frame has its ranges."""

import json
import sys

import numpy as np

from common import JOB, MEASURED, PROJECT, equal, scan


def check_waveforms(beamcast, folder):
    lidar = JOB.split("[[sensor]]")[1].replace("max_m = 6.0", "max_m = 60.0")
    job = f'scene = "{PROJECT / "scenes" / "room.glb"}"\n[[sensor]]{lidar}{MEASURED}'.replace("{{", "{").replace("}}", "}")
    job += '[output]\ndir = "out"\nformats = ["npz", { format = "waveform", bin_m = 0.03, from_m = 1.0, to_m = 4.0 }]\n'
    files = scan(beamcast, folder, job, "waveforms") / "lidar"
    with np.load(files / "000000.waveform.npz") as arrays, np.load(files / "000000.npz") as frame:
        about = json.loads(arrays["about"].item())
        returns = [frame[name] for name in frame.files if name.split("/")[-1] == "range"]
        offsets, sigma = arrays["offsets"], arrays["sigma"].item()
        ranges, amplitudes, samples = (arrays[name] for name in ("range", "amplitude", "samples"))
    equal("waveform: pixels", len(offsets), about["rows"] * about["columns"] + 1)
    equal("waveform: offsets", (offsets[0], offsets[-1], bool((np.diff(offsets.astype(np.int64)) >= 0).all())), (0, len(ranges), True))
    equal("waveform: samples", list(samples.shape), [about["rows"], about["columns"], 101])
    places = about["samples"]["from_m"] + about["samples"]["bin_m"] * np.arange(101)
    most = 0
    for pixel in range(0, len(offsets) - 1, 7):
        own = slice(offsets[pixel], offsets[pixel + 1])

        def pulses(r):
            z = (r[:, None] - ranges[own]) / sigma
            return z, amplitudes[own] * np.exp(-0.5 * z**2)

        height = pulses(places)[1].sum(axis=1)
        # A float32 is within 2^-24 of its value; what is below 2^-53 of a Gaussian's peak is left out.
        wrong = np.abs(samples.reshape(-1, 101)[pixel] - height) > 6e-8 * height + 1e-15 * amplitudes[own].sum()
        equal(f"waveform: samples of pixel {pixel}", int(wrong.sum()), 0)
        found = np.array([of.reshape(-1)[pixel] for of in returns], np.float64)
        found = found[np.isfinite(found)]
        most = max(most, len(found))
        # At a peak the slope is 0. A range in float32 is off by 2^-24 of it, which the curvature, at most sum/sigma^2, makes a slope.
        z, each = pulses(found)
        slope, sums = np.abs((z * each).sum(axis=1)) / sigma, np.abs((z**2 - 1) * each).sum(axis=1) / sigma**2
        equal(f"waveform: peaks of pixel {pixel}", int((slope > 6e-8 * found * sums * 1.01 + 1e-12).sum()), 0)
    if most < 2:
        sys.exit("no pulse has two peaks, and the waveforms test nothing")
