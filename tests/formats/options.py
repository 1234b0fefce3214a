"""Every sample of a deep EXR is the return of that number in the EXR's parts, and options of EXR and PLY change no value but those
that half floats round."""

import json
import sys

import numpy as np
import open3d as o3d
import OpenEXR
import plyfile

from common import JOB, PROJECT, SENSORS, equal, parts_of, scan


def check_deep(path, parts, depth):
    part = OpenEXR.File(str(path), separate_channels=True).parts[0]
    seen = np.stack([np.isfinite(of_return[depth]) for of_return in parts])
    counts = seen.sum(axis=0)
    names = sorted({name for name in parts[0] if name != "Y"} | {"Z"})
    equal(f"{path}: channels", sorted(part.channels), names)
    equal(f"{path}: most samples", part.header["maxSamplesPerPixel"], counts.max())
    for name in names:
        source = name if name in parts[0] else depth
        pixels = part.channels[name].pixels.reshape(-1)
        equal(f"{path}: samples of {name}", [0 if pixel is None else len(pixel) for pixel in pixels], counts.reshape(-1))
        values = np.concatenate([pixel for pixel in pixels if pixel is not None])
        equal(f"{path}: type of {name}", str(values.dtype), str(parts[0][source].dtype))
        # Pixel by pixel, and in each the returns in their order.
        expected = np.stack([of_return[source] for of_return in parts])
        equal(f"{path}: {name}", values, np.moveaxis(expected, 0, -1)[np.moveaxis(seen, 0, -1)])


def check_options(beamcast, folder):
    """A LiDAR of two returns a pulse, and a camera, in each way that EXR, deep EXR and PLY can be written."""
    two = """footprint = { divergence_mrad = [9.0, 9.0], kind = "1/e2" }\nreceiver = { returns = "dual" }\n"""
    job = JOB.format(scene=PROJECT / "scenes" / "room.glb").replace("rotating.columns", two + "rotating.columns")
    runs = [
        ["exr", "deep", "ply"],
        ["exr compression zips", "deep compression none", "ply ascii true"],
        ["exr compression rle", "ply flavour cloudcompare"],
        ["exr compression piz", "ply flavour cloudcompare ascii true"],
        ["exr compression none", "deep level 9"],
        ["exr level 9"],
        ["exr half true"],
    ]

    def table(words):
        name, *options = words.split(" ")
        pairs = [f"{key} = {value if value == 'true' or value.isdigit() else json.dumps(value)}" for key, value in zip(options[::2], options[1::2])]
        return f"{{ {', '.join([f'format = {json.dumps(name)}', *pairs])} }}"

    folder = folder / "options"
    folder.mkdir()
    for number, formats in enumerate(runs):
        scan(beamcast, folder, job + f"formats = [{', '.join(map(table, formats))}]\n", str(number))
    for sensor in SENSORS:
        files = [folder / str(number) / sensor for number in range(len(runs))]
        parts = parts_of(files[0] / "000000.exr")
        if sensor == "lidar" and not np.isfinite(parts[1]["range"]).any():
            sys.exit("no pulse has two returns, and deep images test nothing")
        check_deep(files[0] / "000000.deep.exr", parts, "Z" if sensor == "camera" else "range")
        check_deep(files[1] / "000000.deep.exr", parts, "Z" if sensor == "camera" else "range")
        check_deep(files[4] / "000000.deep.exr", parts, "Z" if sensor == "camera" else "range")
        sizes = {path.stat().st_size for path in (file / "000000.exr" for file in files)}
        equal(f"{sensor}: sizes of the compressions", len(sizes), len(runs))
        for file in files[1:]:
            for of_return, again in zip(parts, parts_of(file / "000000.exr"), strict=True):
                for name, values in of_return.items():
                    rounded = file == files[-1] and (name == "intensity" or name.startswith("normal."))
                    equal(f"{file}: {name}", again[name], values.astype(np.float16) if rounded else values)
                    if rounded and again[name].dtype != np.float16:
                        sys.exit(f"{file}: {name} is {again[name].dtype}")
        ply = plyfile.PlyData.read(files[0] / "000000.ply")["vertex"].data
        plain, prefixed = ply.dtype.names, [name if name in "xyz" else f"scalar_{name}" for name in ply.dtype.names]
        for file, names in zip(files[1:4], (plain, prefixed, prefixed)):
            again = plyfile.PlyData.read(file / "000000.ply")["vertex"].data
            by_open3d = o3d.t.io.read_point_cloud(str(file / "000000.ply")).point
            equal(f"{file}: fields", again.dtype.names, names)
            equal(f"{file} by Open3D", by_open3d.positions.numpy(), np.stack([ply[axis] for axis in "xyz"], axis=-1))
            for name, of_plain in zip(names, plain):
                equal(f"{file} by plyfile: {name}", again[name], ply[of_plain])
                if name not in "xyz":
                    equal(f"{file} by Open3D: {name}", by_open3d[name].numpy().reshape(-1), ply[of_plain])
