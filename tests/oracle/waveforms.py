"""Compares waveforms of beamcast with those of mitransient, a transient path tracer that shares no code with it.

    python -m venv oracle && oracle/bin/pip install mitsuba mitransient
    oracle/bin/python tests/oracle/waveforms.py target/release/beamcast

Three scenes are rendered: a slanted plane, the edge of a plate before a wall, and a concave corner. The first two are scanned by
`beamcast explain` as well. The corner is a reference for light that goes from wall to wall, which beamcast does not follow: the
errors of ranges by continuous-wave time of flight are printed for one, two, three and all bounces. The program prints figures with
their standard errors. It exits with 1 if a figure of beamcast is farther from the oracle's than four standard errors and what the
sub-rays of a beam may be off, or if a single bounce in the corner is farther than four standard errors from its integral.

Mitsuba 3.9 stops with an error of LLVM 14 and 15 and works with LLVM 19; DRJIT_LIBLLVM_PATH names the library where the system has an
older one. The tool takes half a minute on two cores. No continuous integration runs it, because it is only needed when the code of
beams and waveforms changes.
"""

import argparse
import base64
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import mitsuba as mi

mi.set_variant("llvm_ad_mono")
import mitransient  # noqa: E402, F401 (it registers its plugins with Mitsuba)
from mitransient.utils import ArrayXf  # noqa: E402

SPEED_OF_LIGHT_M_S = 299792458.0
# Rays of a perspective camera begin at its near plane, so paths are shorter by this length.
NEAR_CLIP_M = 0.01
TRANSFORM = mi.ScalarTransform4f

# Coordinates are glTF's: the beam goes along -z, y is up.
RHO = 0.5
PULSE_FWHM_S = 5e-9
SIGMA_M = 0.5 * SPEED_OF_LIGHT_M_S * PULSE_FWHM_S / math.sqrt(8.0 * math.log(2.0))
# The largest error of the share of a beam beyond an edge with 37 sub-rays (docs/measurement.md).
EDGE_ERROR = 0.066


def plate(middle, a, b):
    """A parallelogram: its middle and half of its edges."""
    return tuple(np.array(v, dtype=float) for v in (middle, a, b))


def slanted(range_m, tilt_deg):
    tilt = math.radians(tilt_deg)
    return [plate([0, 0, -range_m], [5, 0, 0], [0, 5 * math.cos(tilt), -5 * math.sin(tilt)])]


def edge(near_m, far_m, offset_m):
    """A plate to the right of the beam's axis, from `offset_m` on, before a wall."""
    return [plate([5 + offset_m, 0, -near_m], [5, 0, 0], [0, 5, 0]), plate([0, 0, -far_m], [9, 0, 0], [0, 9, 0])]


def explain(program, plates, divergence_mrad):
    """The story that beamcast tells of one pulse along -z."""
    nodes, meshes, accessors, views, data = [], [], [], [], b""
    for number, (middle, a, b) in enumerate(plates):
        corners = np.array([middle - a - b, middle + a - b, middle + a + b, middle - a + b], dtype="<f4")
        triangles = np.array([0, 1, 2, 0, 2, 3], dtype="<u2")
        for block, extra in ((corners, {"componentType": 5126, "count": 4, "type": "VEC3",
                                        "min": corners.min(0).tolist(), "max": corners.max(0).tolist()}),
                             (triangles, {"componentType": 5123, "count": 6, "type": "SCALAR"})):
            views.append({"buffer": 0, "byteOffset": len(data), "byteLength": block.nbytes})
            accessors.append({"bufferView": len(views) - 1, **extra})
            data += block.tobytes()
        primitive = {"attributes": {"POSITION": 2 * number}, "indices": 2 * number + 1, "material": 0}
        meshes.append({"primitives": [primitive]})
        nodes.append({"name": f"plate{number}", "mesh": number})
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    gltf = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(len(nodes)))}], "nodes": nodes,
            "materials": [{"name": "grey"}], "meshes": meshes, "accessors": accessors, "bufferViews": views,
            "buffers": [{"byteLength": len(data), "uri": uri}]}
    # The world's y is glTF's -z.
    job = f"""scene = "scene.gltf"
[materials.grey]
kind = "lambert"
reflectance = {RHO}
[[sensor]]
name = "one"
pose = {{ rpy_deg = [0.0, 0.0, 90.0] }}
[sensor.rotating]
elevations_deg = [0.0]
columns = 4
rate_hz = 10.0
[sensor.range]
max_m = 200.0
[sensor.footprint]
divergence_mrad = [{divergence_mrad}, {divergence_mrad}]
kind = "1/e2"
samples = 37
[sensor.receiver]
returns = 4
pulse_fwhm_ns = {PULSE_FWHM_S * 1e9}
[output]
dir = "out"
"""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "scene.gltf").write_text(json.dumps(gltf))
        Path(folder, "job.toml").write_text(job)
        for column in range(4):
            args = [program, "explain", "job.toml", "0", str(column), "--json"]
            told = json.loads(subprocess.run(args, cwd=folder, check=True, capture_output=True, text=True).stdout)
            if told["pulse"]["world_direction"][1] > 0.999:
                return told
    raise SystemExit("no pulse goes along y")


def shape(one, bsdf):
    middle, a, b = one
    normal = np.cross(a, b)
    matrix = np.eye(4)
    matrix[:3] = np.array([a, b, normal / np.linalg.norm(normal), middle]).T
    return {"type": "rectangle", "to_world": TRANSFORM(matrix), "bsdf": {"type": "twosided", "inner": bsdf}}


def diffuse(rho):
    return {"type": "diffuse", "reflectance": {"type": "spectrum", "value": rho}}


def histograms(plates, divergence_mrad, ranges_m, seeds=16):
    """The oracle's energy over the range, for each seed, and the ranges in the middle of its bins. A projector with the beam's
    profile lights the plates, and a camera beside it takes up what comes back."""
    radii = 2.5  # All but exp(-12.5) of the beam lies within so many 1/e2 radii.
    fov = math.degrees(2.0 * math.atan(radii * 0.5e-3 * divergence_mrad))
    at = (np.arange(512) + 0.5) / 512 * 2.0 - 1.0
    profile = np.exp(-2.0 * (radii * at) ** 2)
    image = mi.Bitmap((profile[:, None] * profile[None, :]).astype(np.float32)[:, :, None])
    looks = TRANSFORM().look_at(origin=[0, 0, 0], target=[0, 0, -1], up=[0, 1, 0])
    # A whole number of millimetres lies in the middle of a bin.
    side, bin_m = 16, 0.001
    first_m, bins = ranges_m[0] - 0.5 * bin_m, round((ranges_m[1] - ranges_m[0]) / bin_m)
    scene = {
        "type": "scene",
        "integrator": {"type": "transient_path", "max_depth": 2, "temporal_filter": "box"},
        "light": {"type": "projector", "fov": fov, "to_world": looks,
                  "irradiance": {"type": "bitmap", "bitmap": image, "raw": True}},
        "sensor": {"type": "perspective", "fov": fov, "near_clip": NEAR_CLIP_M, "to_world": looks,
                   "sampler": {"type": "independent", "sample_count": 512},
                   "film": {"type": "transient_hdr_film", "width": side, "height": side, "rfilter": {"type": "box"},
                            "temporal_bins": bins, "bin_width_opl": 2.0 * bin_m,
                            "start_opl": 2.0 * first_m - NEAR_CLIP_M}},
    }
    scene |= {f"plate{number}": shape(one, diffuse(RHO)) for number, one in enumerate(plates)}
    scene = mi.load_dict(scene)
    found = [np.array(mi.render(scene, seed=seed)[1], dtype=np.float64) for seed in range(seeds)]
    return np.array([one.sum(axis=(0, 1, 3)) for one in found]), ranges_m[0] + np.arange(bins) * bin_m


def peaks(energies, at_m):
    """The ranges of the peaks of a waveform: energies at ranges, each with a pulse."""
    some = energies > 0.0
    energies, at_m = energies[some], at_m[some]
    grid = np.arange(at_m.min() - SIGMA_M, at_m.max() + SIGMA_M, 0.0005)
    height = np.zeros_like(grid)
    for energy, range_m in zip(energies, at_m):
        height += energy * np.exp(-0.5 * ((grid - range_m) / SIGMA_M) ** 2)
    inner = np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:])) + 1
    # The vertex of the parabola through the logarithms of three heights.
    a, b, c = (np.log(height[inner + step]) for step in (-1, 0, 1))
    return grid[inner] + 0.0005 * 0.5 * (a - c) / (a - 2.0 * b + c)


def spread_m(energies, at_m):
    """The standard deviation of energies over their ranges."""
    mean = energies @ at_m / energies.sum()
    return math.sqrt(energies @ (at_m - mean) ** 2 / energies.sum())


def with_error(values):
    values = np.asarray(values)
    return values.mean(axis=0), values.std(axis=0, ddof=1) / math.sqrt(len(values))


class Table:
    """Prints figures of both programs, and remembers those that are too far apart."""

    def __init__(self):
        self.wrong = 0

    def row(self, what, ours, oracle, error, allowed):
        bad = abs(ours - oracle) > allowed + 4.0 * error
        self.wrong += bad
        print(f"  {what:44} {ours:12.6f} {oracle:12.6f} ± {error:.6f}{'   TOO FAR' if bad else ''}")


def slanted_plane(program, table):
    """3 mrad at 50 m on a plane at 60 degrees: w/2·tan θ = 65 mm of spread."""
    range_m, tilt_deg, mrad = 50.0, 60.0, 3.0
    print(f"a plane at {range_m} m, tilted by {tilt_deg}°, beam of {mrad} mrad: beamcast, oracle ± standard error")
    story, square = (explain(program, slanted(range_m, tilt), mrad) for tilt in (tilt_deg, 0.0))
    energy, at_m = histograms(slanted(range_m, tilt_deg), mrad, (49.0, 51.0))
    head_on, _ = histograms(slanted(range_m, 0.0), mrad, (49.0, 51.0), 4)
    spread = [spread_m(e, at_m) for e in energy]
    parts = story["signal"]["parts"]
    ours = spread_m(*(np.array([part[key] for part in parts]) for key in ("energy", "range_m")))
    one = story["returns"][0]
    slant_m = 0.25e-3 * mrad * range_m * math.tan(math.radians(tilt_deg))
    # The sub-rays have the second moment of the beam, but its fourth moment they have not. With the variance v and the kurtosis k of
    # the spread, a = v/sigma^2, the squared width that follows from the peak's curvature is sigma^2·(1 + a + (3 - k)·a^2/2): up to
    # sigma·a^2/2 more width than a Gaussian beam's, because k is at least 1.
    table.row("range of the echo, m", one["range_m"], *with_error([peaks(e, at_m)[0] for e in energy]), 1e-4)
    table.row("spread of its energy in range, m", ours, *with_error(spread), 2e-5)
    widths = np.sqrt(SIGMA_M**2 + np.square(spread))
    table.row("its width, m", one["width_m"], *with_error(widths), 0.5 * SIGMA_M * (slant_m / SIGMA_M) ** 4)
    ratio = story["met"][0]["energy"] / square["met"][0]["energy"]
    table.row("energy, relative to a plane at a right angle", ratio, *with_error(energy.sum(axis=1) / head_on.sum(axis=1).mean()), 1e-4)
    print(f"  closed form of the spread {slant_m:.6f} m")


def edges(program, table):
    mrad = 5.0
    for far_m, shift in ((25.0, 0.0), (25.0, 0.25), (20.8, 0.0), (20.5, 0.0)):
        offset_m = shift * 0.5e-3 * mrad * 20.0
        plates = edge(20.0, far_m, offset_m)
        print(f"an edge at 20 m, {shift} w beside the axis, a wall at {far_m} m: beamcast, oracle ± standard error")
        story = explain(program, plates, mrad)
        energy, at_m = histograms(plates, mrad, (19.9, far_m + 0.1))
        near = energy[:, at_m < 20.3].sum(axis=1)
        far = energy[:, at_m >= 20.3].sum(axis=1)
        met = {one["object"]: one["energy"] for one in story["met"]}
        share = met["plate0"] / (met["plate0"] + met["plate1"] * (far_m / 20.0) ** 2)
        table.row("share of the beam on the plate", share, *with_error(near / (near + far * (far_m / 20.0) ** 2)), EDGE_ERROR)
        print(f"  closed form of the share {0.5 * math.erfc(math.sqrt(2.0) * shift):.6f}")
        ratio, error = with_error(near / far)
        ours = met["plate0"] / met["plate1"]
        print(f"  {'ratio of the energies, near to far':44} {ours:12.6f} {ratio:12.6f} ± {error:.6f}")
        ours = [one["range_m"] for one in story["returns"]]
        oracle = [peaks(e, at_m) for e in energy]
        print("  peaks, m:", " ".join(f"{r:.4f}" for r in ours), "|", " ".join(f"{r:.4f}" for r in np.mean(oracle, axis=0)))
        if len(ours) == 2:
            # The error of the shares moves the peaks where the echoes overlap.
            exact = 0.5 * math.erfc(math.sqrt(2.0) * shift)
            distances = [np.diff(peaks(np.array([s, (1.0 - s) * (20.0 / far_m) ** 2]), np.array([20.0, far_m])))[0]
                         for s in (exact, exact - EDGE_ERROR, exact + EDGE_ERROR)]
            # The rim of the beam is farther away than its axis, on both surfaces, by up to R·(half divergence)^2/2.
            rim_m = 0.5 * far_m * (0.5e-3 * mrad) ** 2
            allowed = np.ptp(distances) + rim_m
            table.row("distance of the peaks, m", ours[1] - ours[0], *with_error([p[1] - p[0] for p in oracle]), allowed)


def corner_phasors(rho, s_m, depth, seed, frequencies_hz, side=32, samples=1024):
    """The phasors of small pixels at s from the edge of a corner, and the distance. Walls of 1 m x 1 m; camera and light are at 1.5 m
    on the diagonal."""
    camera = [1.5 / math.sqrt(2.0), 1.5 / math.sqrt(2.0), 0.0]
    point = [s_m, 0.0, 0.0]
    walls = [plate([0.5, 0, 0], [0, 0, 0.5], [0.5, 0, 0]), plate([0, 0.5, 0], [0, 0.5, 0], [0, 0, 0.5])]
    scene = {
        "type": "scene",
        # Roulette would only add noise: without it, paths end where they leave the corner.
        "integrator": {"type": "transient_path", "max_depth": depth, "rr_depth": 1000, "temporal_filter": "box"},
        "light": {"type": "point", "position": camera, "intensity": {"type": "spectrum", "value": 1.0}},
        "sensor": {"type": "perspective", "fov": 1e-3, "near_clip": NEAR_CLIP_M,
                   "to_world": TRANSFORM().look_at(origin=camera, target=point, up=[0, 0, 1]),
                   "sampler": {"type": "independent", "sample_count": samples},
                   "film": {"type": "phasor_hdr_film", "width": side, "height": side, "rfilter": {"type": "box"},
                            "temporal_bins": 4096, "bin_width_opl": 0.003, "start_opl": -NEAR_CLIP_M}},
    }
    scene |= {f"wall{number}": shape(wall, diffuse(rho)) for number, wall in enumerate(walls)}
    scene = mi.load_dict(scene)
    # The film chooses its frequencies by a wavelet of another use. They are a path's cycles a metre, the first for the energy.
    cycles = [0.0, *(f / SPEED_OF_LIGHT_M_S for f in frequencies_hz)]
    scene.sensors()[0].film().frequencies = ArrayXf([mi.Float(f) for f in cycles])
    tensor = np.array(mi.render(scene, seed=seed)[1], dtype=np.float64).reshape(-1, len(cycles), 2)
    return tensor[..., 0] - 1j * tensor[..., 1], math.dist(camera, point)


def corner(table):
    frequencies_hz = np.array([20e6, 100e6])
    print("a concave corner: bounces, indirect/direct ± standard error, error of the range at 20 and 100 MHz in mm ± standard error")
    for rho, s_m in ((0.8, 0.05), (0.8, 0.1), (0.8, 0.3), (0.8, 0.5), (0.5, 0.3)):
        direct, range_m = corner_phasors(rho, s_m, 2, 0, frequencies_hz, samples=16)
        turn = np.exp(-4j * math.pi * frequencies_hz * range_m / SPEED_OF_LIGHT_M_S)
        to_mm = 1e3 * SPEED_OF_LIGHT_M_S / (4.0 * math.pi * frequencies_hz)
        print(f"  reflectance {rho}, {s_m} m from the edge")
        for bounces, depth in ((1, 3), (2, 4), (3, 5), (None, 60)):
            phasors = np.concatenate([corner_phasors(rho, s_m, depth, 10 * depth + seed, frequencies_hz)[0] for seed in range(4)])
            blocks = phasors.reshape(32, -1, phasors.shape[1]).mean(axis=1)
            ratio, ratio_error = with_error(blocks[:, 0].real / direct[:, 0].real.mean() - 1.0)
            errors, errors_error = with_error(np.angle(blocks[:, 1:] * turn) * to_mm)
            told = "   ".join(f"{e:7.2f} ± {d:.2f}" for e, d in zip(errors, errors_error))
            print(f"    {bounces or 'all':>3}   {ratio:.4f} ± {ratio_error:.4f}   {told}")
            if bounces == 1:
                expected = corner_quadrature(rho, s_m, [0.0, *frequencies_hz])
                table.row("one bounce: quadrature, oracle", expected[0].real - 1.0, ratio, ratio_error, 0.0)
                for f, e, d, z, mm in zip(frequencies_hz, errors, errors_error, expected[1:], to_mm):
                    table.row(f"one bounce, {f / 1e6:.0f} MHz, mm", np.angle(z) * mm, e, d, 0.0)


def corner_quadrature(rho, s_m, frequencies_hz, nodes=200):
    """The phasor of direct light and one bounce, relative to direct light: 1 + (rho/pi)·integral of E_q/E_p·cos a·cos b/d^2 over the
    other wall, with the phase of the longer way, by Gauss's rule in the cube root of the distance from the edge."""
    x, weights = np.polynomial.legendre.leggauss(nodes)
    u = 0.5 * (x + 1.0)
    y, z = np.meshgrid(u**3, 0.5 * x, indexing="ij")
    area = np.outer(1.5 * weights * u**2, 0.5 * weights)
    c = 1.5 / math.sqrt(2.0)
    r_p = math.hypot(s_m - c, c)
    r_q = np.sqrt(c * c + (y - c) ** 2 + z**2)
    d2 = s_m**2 + y**2 + z**2
    ratio = (c / r_q**3) / (c / r_p**3)
    kernel = rho / math.pi * ratio * s_m * y / (d2 * d2) * area
    longer = r_q + np.sqrt(d2) - r_p
    return [1.0 + (kernel * np.exp(2j * math.pi * f * longer / SPEED_OF_LIGHT_M_S)).sum() for f in frequencies_hz]


def main():
    parser = argparse.ArgumentParser(description="compares beamcast's waveforms with mitransient's")
    parser.add_argument("beamcast", help="the program to compare")
    program = str(Path(parser.parse_args().beamcast).resolve())
    table = Table()
    slanted_plane(program, table)
    edges(program, table)
    corner(table)
    sys.exit(1 if table.wrong else 0)


if __name__ == "__main__":
    main()
