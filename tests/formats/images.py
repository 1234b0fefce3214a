"""Range images as arrays, and images of depth, labels and objects."""

import json
import sys

import cv2
import numpy as np
import open3d as o3d
import PIL.Image

from common import equal


def check_npz(path, parts, names):
    """The arrays of all returns, of which each part of the EXR has one."""
    has_normal = all(f"normal.{axis}" in names for axis in "XYZ")
    alone = [name for name in names if not (has_normal and name.startswith("normal."))]
    with np.load(path, allow_pickle=False) as arrays:
        about = json.loads(arrays["about"].item())
        expected = {"about"}
        for number, exr in enumerate(parts):
            before = f"return{number}/" if number else ""
            expected |= {before + name for name in alone} | ({f"{before}normal"} if has_normal else set())
            for name in alone:
                array = arrays[before + name]
                equal(f"{path}: {before}{name}", array, exr[name])
                if array.dtype != exr[name].dtype:
                    sys.exit(f"{path}: {before}{name} is {array.dtype}, and the EXR's {exr[name].dtype}")
            if has_normal:
                equal(f"{path}: {before}normal", arrays[f"{before}normal"], np.stack([exr[f"normal.{axis}"] for axis in "XYZ"], axis=-1))
        equal(f"{path}: names", sorted(arrays.files), sorted(expected))
        for name, array in about["arrays"].items():
            equal(f"{path}: the shape of {name}", array["shape"], list(arrays[name].shape))


def check_depth(path, channel, depth, scale):
    texts = PIL.Image.open(path).text
    equal(f"{path}: texts", (texts["beamcast:channel"], texts["beamcast:scale"]), (channel, str(scale)))
    expected = np.floor(depth.astype(np.float64) * scale + 0.5)
    expected[~np.isfinite(depth) | (expected > 65535)] = 0
    for reader, image in [
        ("PIL", np.asarray(PIL.Image.open(path))),
        ("OpenCV", cv2.imread(str(path), cv2.IMREAD_UNCHANGED)),
        ("Open3D", o3d.t.io.read_image(str(path)).as_tensor().numpy()[..., 0]),
    ]:
        equal(f"{path} by {reader}", image, expected.astype(np.uint16))
        if image.dtype != np.uint16:
            sys.exit(f"{path} by {reader} is {image.dtype}")


def check_numbers(path, numbers, has_palette=False):
    image = PIL.Image.open(path)
    equal(f"{path} by PIL", np.asarray(image), numbers)
    if has_palette:
        colours = np.reshape(image.getpalette(), (-1, 3))
        equal(f"{path}: different colours", len(np.unique(colours, axis=0)), 256)
        equal(f"{path}: 0 is black", colours[0], [0, 0, 0])
        # OpenCV has no indexed images, and reads the colours, blue first.
        equal(f"{path} by OpenCV", cv2.imread(str(path))[..., ::-1], colours[numbers])
    else:
        equal(f"{path} by OpenCV", cv2.imread(str(path), cv2.IMREAD_UNCHANGED), numbers)
