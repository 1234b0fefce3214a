"""Reads the folders of data sets back with the tools that their users have, and compares every value with the EXR's.

    python tests/formats/folders.py BEAMCAST    # with tests/formats/requirements.txt

A drive past a car and a walker is scanned by a LiDAR of 10 Hz and a camera of 25 Hz as KITTI's and nuScenes' folders. Numbers
that the formats hold as they are have equal bits: ranges have become points, which are those of the NPY, which check.py holds to the
EXR. Poses and boxes are those of poses.csv and boxes.jsonl.
"""

import collections
import csv
import json
import os
import pathlib
import sys
import tempfile

os.environ["MPLBACKEND"] = "agg"

import numpy as np
import pykitti
from nuscenes.nuscenes import NuScenes
from nuscenes.utils.data_classes import LidarPointCloud
from pyquaternion import Quaternion

import common
from common import PROJECT, equal, near, read_exr, scan

JOB = f"""
scene = "{PROJECT}/scenes/drive.glb"
labels = {{ road = 40, car = 10, walker = 30 }}

[[sensor]]
name = "LIDAR_TOP"
pose = {{ position_m = [0.0, 0.0, 1.9], rpy_deg = [1.0, 2.0, 30.0] }}
[sensor.rotating]
elevations_deg = {{ from = 15.0, to = -25.0, count = 32 }}
columns = 512
rate_hz = 10.0
[sensor.range]
min_m = 0.5
max_m = 60.0

[[sensor]]
name = "CAM_FRONT"
pose = {{ position_m = [0.6, 0.0, 1.4] }}
[sensor.pinhole]
width_px = 160
height_px = 90
hfov_deg = 80.0
rate_hz = 25.0
[sensor.range]
max_m = 60.0

[trajectory]
file = "{PROJECT}/configs/street_drive/ego.csv"

[sequence]
duration_s = 0.4
start_s = 2.0

[[actor]]
name = "oncoming car"
scene = "{PROJECT}/scenes/actors/car.glb"
trajectory = {{ pose = {{ position_m = [20.0, 1.75, 0.0], rpy_deg = [0.0, 0.0, 180.0] }}, twist = {{ linear_m_s = [8.0, 0.0, 0.0] }} }}

[[actor]]
name = "walker"
scene = "{PROJECT}/scenes/actors/walker.glb"
trajectory = {{ pose = {{ position_m = [-15.0, -5.0, 0.0], rpy_deg = [0.0, 0.0, 90.0] }}, twist = {{ linear_m_s = [1.25, 0.0, 0.0] }} }}

[output]
dir = "out"
formats = ["exr", "npy", "color", "kitti", {{ format = "nuscenes", lidarseg = true }}]

[truth]
poses = true
boxes = "tracked"
"""
LIDAR, CAMERA = "LIDAR_TOP", "CAM_FRONT"
# The world is some tens of metres wide. Coordinates have steps of 7e-15 m there, and turning poses and boxes into other frames
# rounds a few dozen times.
NEAR_M = 1e-12


def matrix(translation, wxyz):
    pose = Quaternion(*wxyz).transformation_matrix
    pose[:3, 3] = translation
    return pose


class Run:
    """What the run's other files say."""

    def __init__(self, folder):
        self.folder, self.poses, self.boxes = folder, {}, collections.defaultdict(dict)
        with open(folder / "poses.csv", newline="") as file:
            for row in csv.DictReader(file):
                number = {key: float(value) for key, value in row.items() if key != "sensor"}
                self.poses[row["sensor"], int(row["frame"])] = number
        for line in (folder / "boxes.jsonl").read_text().splitlines():
            box = json.loads(line)
            self.boxes[box["sensor"], box["frame"]][box["track"]] = box

    def frames(self, sensor):
        return sorted(frame for name, frame in self.poses if name == sensor)

    def time_s(self, sensor, frame):
        return self.poses[sensor, frame]["t_s"]

    def world_from_sensor(self, sensor, frame):
        row = self.poses[sensor, frame]
        return matrix([row[f"{axis}_m"] for axis in "xyz"], [row[f"q{axis}"] for axis in "wxyz"])

    def exr(self, sensor, frame):
        return read_exr(self.folder / sensor / f"{frame:06}.exr")

    def npy(self, sensor, frame):
        return np.load(self.folder / sensor / f"{frame:06}.npy", allow_pickle=False)


def stacked(points, axes="xyz"):
    return np.stack([points[axis] for axis in axes], axis=-1)


def check_kitti_clouds(run, sensor):
    for frame in run.frames(sensor):
        exr, npy = run.exr(sensor, frame), run.npy(sensor, frame)
        seen = np.isfinite(exr["range"])
        if not 0 < seen.sum() < seen.size or len(np.unique(exr["id.semantic"][seen])) < 3:
            sys.exit(f"{sensor}: the frame has no misses or no labels, and tests nothing")
        points = np.fromfile(run.folder / sensor / "velodyne" / f"{frame:06}.bin", np.float32).reshape(-1, 4)
        # A camera's optical frame has its axes elsewhere: forward is z, left -x and up -y.
        places = stacked(npy) if sensor == LIDAR else np.stack([npy["z"], 0 - npy["x"], 0 - npy["y"]], axis=-1)
        equal(f"{sensor} velodyne: points", points[:, :3], places)
        equal(f"{sensor} velodyne: intensity", points[:, 3], exr["intensity"][seen])
        labels = np.fromfile(run.folder / sensor / "labels" / f"{frame:06}.label", np.uint32)
        equal(f"{sensor} labels: label", labels & 0xFFFF, exr["id.semantic"][seen])
        equal(f"{sensor} labels: instance", labels >> 16, exr["id.instance"][seen])


def check_kitti_poses(run, sensor, folder):
    """As the API of SemanticKITTI and KISS-ICP read them, and with pykitti, which has sequences and poses in folders apart."""
    (folder / "sequences").mkdir(parents=True)
    (folder / "poses").mkdir()
    (folder / "sequences" / "00").symlink_to(run.folder / sensor, target_is_directory=True)
    (folder / "poses" / "00.txt").symlink_to(run.folder / sensor / "poses.txt")
    data = pykitti.odometry(folder, "00")
    tr, frames = data.calib.T_cam0_velo, run.frames(sensor)
    first = np.linalg.inv(run.world_from_sensor(sensor, frames[0]))
    equal(f"{sensor} poses: frames", (len(data.poses), len(data.velo_files)), (len(frames), len(frames)))
    equal(f"{sensor} poses: the first", data.poses[0], np.eye(4))
    for index, frame in enumerate(frames):
        pose = np.linalg.inv(tr) @ data.poses[index] @ tr
        near(f"{sensor} poses: {frame}", pose[:3], (first @ run.world_from_sensor(sensor, frame))[:3], NEAR_M)
        since = run.time_s(sensor, frame) - run.time_s(sensor, frames[0])
        equal(f"{sensor} times: {frame}", data.timestamps[index].total_seconds(), round(since, 6))
        points = np.fromfile(run.folder / sensor / "velodyne" / f"{frame:06}.bin", np.float32).reshape(-1, 4)
        equal(f"{sensor} velodyne by pykitti", data.get_velo(index), points)
    times = np.loadtxt(run.folder / sensor / "times.txt")
    equal(f"{sensor} times", times, [run.time_s(sensor, frame) - run.time_s(sensor, frames[0]) for frame in frames])


def optical(sensor_point):
    x, y, z = np.moveaxis(np.asarray(sensor_point), -1, 0)
    return np.stack([-y, -z, x], axis=-1)


def check_kitti_boxes(run, sensor):
    """Corners as KITTI's development kit computes them from the 15 fields."""
    found, names = 0, {10: "car", 30: "walker"}
    for frame in run.frames(sensor):
        boxes = list(run.boxes[sensor, frame].values())
        lines = (run.folder / sensor / "label_2" / f"{frame:06}.txt").read_text().splitlines()
        calib = dict(line.split(": ") for line in (run.folder / sensor / "calib" / f"{frame:06}.txt").read_text().splitlines())
        p2 = np.array(calib["P2"].split(), float).reshape(3, 4)
        equal(f"{sensor} label_2: boxes of {frame}", len(lines), len(boxes))
        for line, box in zip(lines, boxes):
            kind, *rest = line.split()
            truncated, occluded, alpha, *numbers = map(float, rest)
            bounds, (h, w, l), bottom, turn = numbers[:4], numbers[4:7], np.array(numbers[7:10]), numbers[10]
            equal("label_2: type", kind, names[box["label"]])
            equal("label_2: size", (h, w, l), [box[f"{side}_m"] for side in ("height", "width", "length")])
            equal("label_2: truncated", truncated, box["truncation"])
            equal("label_2: occluded", occluded, sum(box["occlusion"] >= share for share in (0.1, 0.5)))
            equal("label_2: bounds", bounds, np.array(box["projected_px"]) - 0.5)
            seen_turn = turn - np.arctan2(bottom[0], bottom[2])
            near("label_2: alpha", [np.cos(alpha), np.sin(alpha)], [np.cos(seen_turn), np.sin(seen_turn)], NEAR_M)
            equal("label_2: alpha", abs(alpha) <= np.pi, True)
            sides = np.array([[x, y, z] for x in (l / 2, -l / 2) for y in (0, -h) for z in (w / 2, -w / 2)])
            c, s = np.cos(turn), np.sin(turn)
            corners = sides @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T + bottom
            place, (x, y, z, q) = box["in_sensor"], box["in_sensor"]["quaternion_xyzw"]
            own = np.array([[x, z, -y] for x, y, z in sides + [0, h / 2, 0]])
            expected = optical(own @ Quaternion(q, x, y, z).rotation_matrix.T + place["centre_m"])
            # The camera is level, and so are the boxes: a turn about one axis is all of it.
            near("label_2: corners", corners, expected, NEAR_M)
            image = np.concatenate([corners, np.ones((8, 1))], axis=1) @ p2.T
            image = image[:, :2] / image[:, 2:]
            least, most = image.min(axis=0), image.max(axis=0)
            # The object's vertices lie in its box, and so do their images. A box has the coordinates of its vertices, whose steps are
            # 2^-19 m up to 32 m, so that they are off by 1e-6 m at most: 1e-5 px, as a pixel is 0.1 m wide at 10 m.
            if not (np.all(bounds[:2] >= least - 1e-5) and np.all(bounds[2:] <= most + 1e-5)):
                sys.exit(f"label_2: the bounds {bounds} are not in the image of the box, {least} to {most}")
            found += 1
    if not found:
        sys.exit("no box is seen, and label_2 tests nothing")


def check_nuscenes(run):
    # The kit knows colours of its own categories only.
    root = run.folder / "nuscenes"
    kit = NuScenes("v1.0-beamcast", str(root), verbose=False, colormap=collections.defaultdict(lambda: (0, 0, 0)))
    frames = [(sensor, frame) for sensor in (LIDAR, CAMERA) for frame in run.frames(sensor)]
    equal("nuscenes: frames", len(kit.sample_data), len(frames))
    key_frames = collections.defaultdict(dict)
    for data in kit.sample_data:
        sensor, frame = data["channel"], int(pathlib.Path(data["filename"]).name.split(".")[0])
        frames.remove((sensor, frame))
        equal("nuscenes: time", data["timestamp"], round(run.time_s(sensor, frame) * 1e6))
        equal("nuscenes: neighbours", (data["prev"] == "", data["next"] == ""), (frame == 0, frame == run.frames(sensor)[-1]))
        if data["next"]:
            equal("nuscenes: next", kit.get("sample_data", data["next"])["prev"], data["token"])
        if data["is_key_frame"]:
            key_frames[data["sample_token"]][sensor] = frame
        ego = kit.get("ego_pose", data["ego_pose_token"])
        mount = kit.get("calibrated_sensor", data["calibrated_sensor_token"])
        pose = matrix(ego["translation"], ego["rotation"]) @ matrix(mount["translation"], mount["rotation"])
        expected = run.world_from_sensor(sensor, frame)
        if sensor == CAMERA:
            # The columns are the optical axes: right, down and forward.
            expected = expected @ np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]], float)
        near(f"nuscenes: pose of {sensor} {frame}", pose, expected, NEAR_M)
        path = kit.get_sample_data_path(data["token"])
        if sensor == CAMERA:
            pictured = (run.folder / sensor / f"{frame:06}.color.png").read_bytes()
            equal("nuscenes: picture", pathlib.Path(path).read_bytes() == pictured, True)
            equal("nuscenes: size", (data["width"], data["height"]), (160, 90))
            continue
        npy, exr = run.npy(sensor, frame), run.exr(sensor, frame)
        seen = np.isfinite(exr["range"])
        fields = np.stack([*stacked(npy).T, exr["intensity"][seen]])
        equal("nuscenes: points", LidarPointCloud.from_file(path).points, fields)
        equal("nuscenes: ring", np.fromfile(path, np.float32).reshape(-1, 5)[:, 4], npy["ring"])
        labels = np.fromfile(root / kit.get("lidarseg", data["token"])["filename"], np.uint8)
        equal("nuscenes: lidarseg", labels, exr["id.semantic"][seen])
    equal("nuscenes: frames that are not there", frames, [])
    equal("nuscenes: samples", [sample["timestamp"] for sample in kit.sample], [round(run.time_s(LIDAR, f) * 1e6) for f in run.frames(LIDAR)])
    check_annotations(run, kit, key_frames)


def check_annotations(run, kit, key_frames):
    levels = {"1": (0, 0.4), "2": (0.4, 0.6), "3": (0.6, 0.8), "4": (0.8, 1.01)}
    found = 0
    for index, sample in enumerate(kit.sample):
        equal("nuscenes: the LiDAR's key frame", key_frames[sample["token"]][LIDAR], index)
        frame = key_frames[sample["token"]][CAMERA]
        away = {f: abs(run.time_s(CAMERA, f) - run.time_s(LIDAR, index)) for f in run.frames(CAMERA)}
        equal("nuscenes: the camera's key frame", frame, min(away, key=lambda f: (round(away[f], 9), f)))
        by_lidar, by_camera = run.boxes[LIDAR, index], run.boxes[CAMERA, frame]
        expected = {track: by_lidar.get(track, by_camera.get(track)) for track in sorted({*by_lidar, *by_camera})}
        rows = [kit.get("sample_annotation", token) for token in sample["anns"]]
        rows.sort(key=lambda row: row["translation"])
        equal("nuscenes: boxes", len(rows), len(expected))
        for row, (track, box) in zip(rows, sorted(expected.items(), key=lambda item: item[1]["in_world"]["centre_m"])):
            equal("nuscenes: centre", row["translation"], box["in_world"]["centre_m"])
            equal("nuscenes: size", row["size"], [box[f"{side}_m"] for side in ("width", "length", "height")])
            x, y, z, w = box["in_world"]["quaternion_xyzw"]
            equal("nuscenes: turn", row["rotation"], (w, x, y, z))
            equal("nuscenes: category", row["category_name"], {10: "car", 30: "walker"}[box["label"]])
            equal("nuscenes: points", row["num_lidar_pts"], by_lidar.get(track, {"points": 0})["points"])
            sight = by_camera.get(track, by_lidar.get(track))
            least, most = levels[row["visibility_token"]]
            equal("nuscenes: visibility", least <= sight["pixels"] / sight["pixels_alone"] < most, True)
            if row["next"]:
                following = kit.get("sample_annotation", row["next"])
                equal("nuscenes: next box", (following["prev"], following["instance_token"]), (row["token"], row["instance_token"]))
            found += 1
    for instance in kit.instance:
        chain = [instance["first_annotation_token"]]
        while following := kit.get("sample_annotation", chain[-1])["next"]:
            chain.append(following)
        equal("nuscenes: chain", (len(chain), chain[-1]), (instance["nbr_annotations"], instance["last_annotation_token"]))
    if found <= len(kit.sample):
        sys.exit("no two boxes are seen, and the annotations test nothing")


def main():
    beamcast = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        run = Run(scan(beamcast, folder, JOB, "out"))
        for sensor in (LIDAR, CAMERA):
            check_kitti_clouds(run, sensor)
            check_kitti_poses(run, sensor, folder / f"kitti-{sensor}")
        check_kitti_boxes(run, CAMERA)
        check_nuscenes(run)
    print(f"{common.checks} values of KITTI's and nuScenes' folders are the EXR's, read by NumPy, pykitti and nuscenes-devkit")


main()
