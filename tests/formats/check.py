"""Reads the program's files back with the tools that their users have, and compares every value with the EXR's.

    python tests/formats/check.py BEAMCAST    # with tests/open3d/requirements.txt

One frame of a LiDAR and one of a camera are scanned in all formats, with misses of each kind, ids, labels and times. Equal means
equal bits, apart from coordinates, which the EXR does not have: those are equal between PCD and NPY, and as far from the sensor
as the EXR's range says. The modules beside this one check a kind of file each, and their first lines say how.
"""

import pathlib
import sys
import tempfile

import cv2
import numpy as np
import PIL.Image

import common
from bags import check_bags
from clouds import check_npy, check_pcd, check_ply
from common import JOB, PROJECT, SENSORS, equal, read_exr, returns_of, scan
from converted import check_convert
from drives import check_drive
from images import check_depth, check_npz, check_numbers
from options import check_options
from read_back import check_read_back
from recordings import check_recordings
from surveyors import check_e57, check_las, check_runs
from waveforms import check_waveforms

# Those whose settings differ go to different folders.
RUNS = [
    'formats = ["exr", "png", "ply", "npy", "npz", "pcd", "las", "laz", "e57", "depth16", "labels", "instances"]',
    """formats = [
    "exr",
    { format = "npz", compressed = true, level = 6 },
    { format = "pcd", organised = true },
    { format = "las", scale = 0.001 },
    { format = "e57", returns = true },
    { format = "depth16", scale = 5000 },
    { format = "labels", bits = 8 },
    { format = "instances", palette = true },
]""",
    'formats = ["npz", { format = "depth16", scale = 256 }, { format = "labels", palette = true }]\n'
    'channels = ["range", "Z", "normal.X"]',
]


def main():
    beamcast = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for number, run in enumerate(RUNS):
            scan(beamcast, folder, JOB.format(scene=PROJECT / "scenes" / "room.glb") + run + "\n", str(number))
        for sensor in SENSORS:
            first, second, third = (folder / str(number) / sensor for number in range(3))
            exr = read_exr(first / "000000.exr")
            channel = "Z" if sensor == "camera" else "range"
            depth = exr[channel]
            names = [name for name in exr if name != "Y"]
            if not 0 < np.isfinite(depth).sum() < depth.size or len(np.unique(exr["id.semantic"])) < 3:
                sys.exit(f"{sensor}: the frame has no misses or no labels, and tests nothing")
            returns = returns_of([exr])
            npy = check_npy(first / "000000.npy", f"{sensor} npy", returns)
            check_ply(first / "000000.ply", npy)
            check_npz(first / "000000.npz", [exr], names)
            check_npz(second / "000000.npz", [exr], names)
            check_npz(third / "000000.npz", [exr], [name for name in names if name in ("range", "Z", "normal.X")])
            check_pcd(first / "000000.pcd", f"{sensor} pcd", returns, npy, organised=False)
            check_pcd(second / "000000.pcd", f"{sensor} organised pcd", returns, npy, organised=True)
            check_read_back(beamcast, first, folder)
            check_convert(beamcast, first, folder, exr, names, npy)
            las = check_las(first / "000000.las", f"{sensor} las", returns, npy, 1e-4)
            check_las(first / "000000.laz", f"{sensor} laz", returns, npy, 1e-4, las)
            check_las(second / "000000.las", f"{sensor} coarse las", returns, npy, 1e-3)
            check_e57(first / "000000.e57", f"{sensor} e57", returns, npy, has_returns=False)
            check_e57(second / "000000.e57", f"{sensor} e57 with returns", returns, npy, has_returns=True)
            for place, scale in [(first, 1000), (second, 5000), (third, 256)]:
                check_depth(place / "000000.depth16.png", channel, depth, scale)
            equal(f"{sensor} png", np.asarray(PIL.Image.open(first / "000000.png")), cv2.imread(first / "000000.png")[..., ::-1])
            check_numbers(first / "000000.labels.png", exr["id.semantic"])
            check_numbers(second / "000000.labels.png", exr["id.semantic"])
            check_numbers(third / "000000.labels.png", exr["id.semantic"], has_palette=True)
            check_numbers(first / "000000.instances.png", exr["id.instance"])
            check_numbers(second / "000000.instances.png", exr["id.instance"], has_palette=True)
        check_waveforms(beamcast, folder)
        check_bags(beamcast, folder)
        check_drive(beamcast, folder)
        check_options(beamcast, folder)
        check_runs(beamcast, folder)
        check_recordings(beamcast, folder)
    tools = f"NumPy, PIL, OpenCV {cv2.__version__}, Open3D, plyfile, pypcd4, laspy, pye57, rosbags and mcap-ros2-support"
    print(f"{common.checks} values are the EXR's, read by {tools}")


main()
