"""What other programs write of our PCD, NPY and NPZ files is the same to `beamcast diff`."""

import subprocess
import sys

import numpy as np
import open3d as o3d
import pypcd4


def check_read_back(beamcast, files, folder):
    """`beamcast diff` finds what other programs write of our files the same."""

    def same(first, second):
        run = subprocess.run([beamcast, "diff", first, second], capture_output=True, text=True)
        if run.returncode != 0 or not run.stdout.startswith("the same"):
            sys.exit(f"{first} and {second}: {run.stdout}{run.stderr}")

    pcd = files / "000000.pcd"
    cloud = pypcd4.PointCloud.from_path(pcd)
    for encoding in (pypcd4.Encoding.BINARY, pypcd4.Encoding.BINARY_COMPRESSED):
        cloud.save(folder / "pypcd4.pcd", encoding=encoding)
        same(pcd, folder / "pypcd4.pcd")
    # Open3D has the fields in an order of its own.
    cloud = o3d.t.io.read_point_cloud(str(pcd))
    for name, options in [("binary", {}), ("text", {"write_ascii": True}), ("compressed", {"compressed": True})]:
        o3d.t.io.write_point_cloud(str(folder / f"{name}.pcd"), cloud, **options)
        same(folder / "binary.pcd", folder / f"{name}.pcd")
    with np.load(files / "000000.npz", allow_pickle=False) as arrays:
        for save in (np.savez, np.savez_compressed):
            save(folder / "numpy.npz", **arrays)
            same(files / "000000.exr", folder / "numpy.npz")
        np.savez(folder / "numpy.npz", **{name: np.asfortranarray(array) for name, array in arrays.items()})
        same(files / "000000.exr", folder / "numpy.npz")
    points = np.load(files / "000000.npy", allow_pickle=False)
    np.save(folder / "numpy.npy", points.astype(np.dtype(points.dtype.descr, align=True).newbyteorder(">")))
    same(files / "000000.ply", folder / "numpy.npy")
