"""Other programs find every value of the NPY and of the EXR in what `beamcast convert` makes of them."""

import subprocess

import laspy
import numpy as np
import pypcd4

from clouds import check_ply
from common import equal
from images import check_npz
from surveyors import same_steps


def check_convert(beamcast, files, folder, exr, names, npy):
    made = {}
    for source, ending in [("npy", "ply"), ("ply", "pcd"), ("npy", "las"), ("las", "laz"), ("exr", "npz")]:
        source, made[ending] = made.get(source, files / f"000000.{source}"), folder / f"converted.{ending}"
        subprocess.run([beamcast, "convert", "-q", "--overwrite", source, made[ending]], check=True)
    check_ply(made["ply"], npy)
    check_npz(made["npz"], [exr], names)
    pcd = pypcd4.PointCloud.from_path(made["pcd"]).pc_data
    las, laz = (laspy.read(made[ending]) for ending in ("las", "laz"))
    equal("converted laz: records", laz.points.array, las.points.array)
    for name in npy.dtype.names:
        equal(f"converted pcd: {name}", pcd[name], npy[name])
        if name in "xyz":
            same_steps(f"converted las: {name}", np.asarray(las[name]), npy[name], 1e-4)
        else:
            # LAS's own intensity is an integer.
            equal(f"converted las: {name}", np.asarray(las["reflectivity" if name == "intensity" else name]), npy[name])
