"""Runs odometries that others have made on bags of a drive, and holds their ways to the true one: KISS-ICP and GenZ-ICP, which see the
clouds alone, and RKO-LIO, which sees the inertial measurements, too.

    python tests/slam/check.py BEAMCAST [--short] [--figure FILE]    # with tests/slam/requirements.txt

Each sensor's drive is scanned as a bag with points as the driver gives them (raw) and with points carried to the sweep's end
(`cloud_time = "end"`), both ideal and with noise. The truth is the bag's `/odom` and `/tf_static`. KISS-ICP and RKO-LIO have their
defaults, GenZ-ICP the settings that it comes with for the outdoors. RKO-LIO reads the bag by its own loader, and finds the places of
the sensors in `/tf_static`.

KISS-ICP's own deskewing, in version 1.3.0, carries points to the time of the sweep's last, so that its pose is that of the sweep's
end, as it is with `cloud_time = "end"`. RKO-LIO is told that each sweep lasts until the next. A raw cloud has no time of its own: it is compared with the truth at the start, in the middle
and at the end of the sweep, and the one that fits best counts.

Apart from any odometry, the points that the truth carries to a wall are held to the wall's plane.

The absolute error is the root mean square of the distances between the positions, after the rigid motion that fits them best in
least squares. The relative error is that of the motion over 10 m of the true way, a metre.

`--short` is for every change: eight seconds with a turn, by the Mid-360 without noise.
"""

import argparse
import collections
import concurrent.futures
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
from genz_icp.config import load_config as load_genz_config
from genz_icp.genz_icp import GenZICP
from kiss_icp.config import load_config
from kiss_icp.kiss_icp import KissICP
from kiss_icp.tools.point_cloud2 import read_point_cloud
from rko_lio.config import LIOConfig, PipelineConfig, TimestampConfig
from rko_lio.dataloaders import LidarIMUSequencer
from rko_lio.dataloaders.rosbag import RosbagDataLoader
from rko_lio.lio_pipeline import LIOPipeline
from rko_lio.util import transform_to_quat_xyzw_xyz
from rosbags.highlevel import AnyReader

import loop

HERE = pathlib.Path(__file__).parent
SHORT = {"sequence.start_s": 20.0, "sequence.duration_s": 8.0}

# A preset, the layout of its driver, and the settings that make its measurement noisy. The Mid-360 has no `[nominal]`: these are the
# limits of its user manual, a range precision of 2 cm at 10 m and an angular precision of 0.15 degrees, as standard deviations.
Device = collections.namedtuple("Device", "name preset layout noise")
DEVICES = [
    Device("VLP-16", "velodyne/vlp-16", "velodyne", {"nominal": "true"}),
    Device("Mid-360", "livox/mid-360", "livox", {"noise": "{ range_floor_m = 0.02, angle_deg = 0.15 }"}),
]

# The points that are given to an odometry: cloud_time; and how it finds its way.
Case = collections.namedtuple("Case", "cloud_time find")
IDEAL, SKEWED, PLANES, INERTIAL = "deskewed by beamcast", "raw", "deskewed by beamcast, GenZ-ICP", "raw with IMU, RKO-LIO"

# What they may be off with ideal data, about twice what was measured (docs/slam.md). KISS-ICP and RKO-LIO align points to points, and the
# points of their maps are 22 cm apart (voxels of 1 m with 20 points). The Mid-360 never scans the same twice, and such errors average
# out: centimetres. The VLP-16's rings hold them back while the car moves off (docs/slam.md): decimetres. GenZ-ICP also aligns points to
# planes, along which rings slide: centimetres and less.
MOST_M = {
    "VLP-16": {IDEAL: 0.8, PLANES: 0.17, INERTIAL: 0.55},
    "Mid-360": {IDEAL: 0.05, PLANES: 0.02, INERTIAL: 0.08},
}
# How many times as far KISS-ICP is off with raw clouds as with deskewed ones. The short drive is too short for the error to grow.
LEAST_RATIO, LEAST_RATIO_SHORT = 1.5, 1.15

# Two houses have their gables in these planes, across the street: the skew of a car that passes moves their points by centimetres and
# more. Points that the truth carries there are off by their own rounding to 32 bits, 2^-24 of at most 100 m along each of three
# axes, and by that of the gable's corners: 1.5e-5 m.
GABLES_X_M, GABLE_Y_M, GABLE_Z_M = (28.0, 74.0), (-20.0, -9.5), (0.5, 5.0)
NEAR_M = 0.5
MOST_AT_WALL_M = 1.5e-5
LEAST_AT_WALL_RAW_M = 0.02
WAY_M = 10.0


def scan(beamcast, folder, device, cloud_time, noisy, sequence):
    settings = {
        "sensor.roof.preset": device.preset,
        "output.formats": f'[{{ format = "mcap", layout = "{device.layout}", imu_hz = 200 }}]',
        "sequence.cloud_time": cloud_time,
        **sequence,
    }
    if noisy:
        settings |= {f"sensor.roof.{key}": value for key, value in device.noise.items()}
    command = [beamcast, "scan", "--quiet", HERE / "drive.toml", "--out", folder]
    for key, value in settings.items():
        command += ["--set", f"{key}={value}"]
    subprocess.run(command, check=True)
    return folder / "bag"


def matrix(position, orientation):
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = position.x, position.y, position.z
    return pose


def nanoseconds(stamp):
    return stamp.sec * 10**9 + stamp.nanosec


def true_poses(bag):
    """world_from_sensor at the stamps of /odom, in nanoseconds: those of the sweeps' starts, and of their ends."""
    poses = {}
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            if connection.topic not in ("/tf_static", "/odom"):
                continue
            message = reader.deserialize(data, connection.msgtype)
            if connection.topic == "/tf_static":
                mount = message.transforms[0].transform
                mount = matrix(mount.translation, mount.rotation)
            else:
                pose = message.pose.pose
                poses[nanoseconds(message.header.stamp)] = matrix(pose.position, pose.orientation)
    return {stamp: pose @ mount for stamp, pose in poses.items()}


def clouds_of(bag):
    """The stamp, the points and their times of each cloud of a bag."""
    with AnyReader([bag]) as reader:
        connections = [c for c in reader.connections if c.topic == "/roof/points"]
        for connection, _, data in reader.messages(connections=connections):
            message = reader.deserialize(data, connection.msgtype)
            yield nanoseconds(message.header.stamp), *read_point_cloud(message)


def by_kiss_icp(deskew):
    """The clouds' stamps, KISS-ICP's pose for each, and each tenth cloud."""

    def find(bag):
        config = load_config(None)
        config.data.deskew = deskew
        config.registration.max_num_threads = 1  # sums in one order
        kiss = KissICP(config)
        stamps, poses, clouds = [], [], []
        for stamp, points, times in clouds_of(bag):
            kiss.register_frame(points, times)
            if len(stamps) % 10 == 0:
                clouds.append(points)
            stamps.append(stamp)
            poses.append(kiss.last_pose)
        return np.array(stamps), np.array(poses), clouds

    return find


def by_genz_icp(bag):
    """The same of GenZ-ICP."""
    genz = GenZICP(load_genz_config(pathlib.Path("outdoor")))
    stamps, poses, clouds = [], [], []
    for stamp, points, _ in clouds_of(bag):
        genz.register_frame(points, None)
        if len(stamps) % 10 == 0:
            clouds.append(points)
        stamps.append(stamp)
        poses.append(genz.last_pose.copy())
    return np.array(stamps), np.array(poses), clouds


class Sweeps(RosbagDataLoader):
    """RKO-LIO's loader, whose sweeps end where the next begin, and not with their last points."""

    def __next__(self):
        kind, data = super().__next__()
        if kind == "lidar":
            data["end_time_ns"] = int(self.ends[np.searchsorted(self.ends, data["end_time_ns"])])
        return kind, data


def by_rko_lio(bag):
    """The clouds' stamps, and RKO-LIO's poses of the sensor at the ends of their sweeps."""
    # The loader guesses whether times are offsets, and skips sweeps that begin with beams into the sky. Livox's are nanoseconds.
    is_absolute = next(clouds_of(bag))[2].max() > 1e6
    times = TimestampConfig(force_absolute=is_absolute, force_relative=not is_absolute)
    loader = Sweeps(bag, None, None, None, None, None, times)
    loader.ends = np.array(sorted(true_poses(bag)))
    places = [transform_to_quat_xyzw_xyz(place) for place in loader.extrinsics]
    lio = LIOConfig(max_num_threads=1)
    config = PipelineConfig(lio=lio, extrinsic_imu2base_quat_xyzw_xyz=places[0], extrinsic_lidar2base_quat_xyzw_xyz=places[1])
    pipeline = LIOPipeline(config)
    for kind, data in LidarIMUSequencer(loader):
        pipeline.add_imu(**data) if kind == "imu" else pipeline.register_scan(**data)
    ends, poses = pipeline.lio.poses_with_timestamps()
    step = loader.ends[1] - loader.ends[0]
    return np.array(ends) - step, np.array([matrix_of(pose) for pose in poses]), []


def matrix_of(pose):
    """The matrix of x, y, z and a quaternion whose scalar comes last."""
    position, orientation = collections.namedtuple("Position", "x y z"), collections.namedtuple("Orientation", "x y z w")
    return matrix(position(*pose[:3]), orientation(*pose[3:]))


CASES = {
    IDEAL: Case("end", by_kiss_icp(False)),
    "raw, deskewed by KISS-ICP": Case("raw", by_kiss_icp(True)),
    SKEWED: Case("raw", by_kiss_icp(False)),
    PLANES: Case("end", by_genz_icp),
    INERTIAL: Case("raw", by_rko_lio),
}
# Each odometry has to find its way in the eight seconds, and not from rest.
SHORT_CASES = [IDEAL, "raw, deskewed by KISS-ICP", SKEWED, PLANES]


def at_parts(truth, stamps, is_end):
    """The true poses at the start, in the middle and at the end of each sweep. Sweeps follow without a pause."""
    told = sorted(truth)
    step = told[1] - told[0]
    start = np.array([truth[stamp - step if is_end else stamp] for stamp in stamps])
    end = np.array([truth[stamp if is_end else stamp + step] for stamp in stamps])
    middle = start.copy()
    middle[:, :3, 3] = 0.5 * (start[:, :3, 3] + end[:, :3, 3])
    for pose, a, b in zip(middle, start, end):
        # The rotation half-way, which is the nearest to the mean of both.
        u, _, v = np.linalg.svd(a[:3, :3] + b[:3, :3])
        pose[:3, :3] = u @ v
    return {"start": start, "middle": middle, "end": end}


def fitted(truth, estimate):
    """The estimated positions after the rigid motion that fits them best to the true ones (Kabsch)."""
    p, q = estimate[:, :3, 3], truth[:, :3, 3]
    u, _, v = np.linalg.svd((p - p.mean(0)).T @ (q - q.mean(0)))
    turn = v.T @ np.diag([1.0, 1.0, np.linalg.det(v.T @ u.T)]) @ u.T
    return (p - p.mean(0)) @ turn.T + q.mean(0)


def relative(truth, estimate):
    """The errors of the motions over WAY_M: root mean squares of metres a metre and of degrees a metre."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(truth[:, :3, 3], axis=0), axis=1))])
    metres, degrees = [], []
    for i in range(len(way)):
        j = np.searchsorted(way, way[i] + WAY_M)
        if j == len(way):
            break
        error = np.linalg.inv(np.linalg.inv(truth[i]) @ truth[j]) @ (np.linalg.inv(estimate[i]) @ estimate[j])
        turn = np.linalg.norm(error[:3, :3] - np.eye(3)) / np.sqrt(8.0)  # the sine of half its angle
        metres.append(np.linalg.norm(error[:3, 3]) / (way[j] - way[i]))
        degrees.append(2.0 * np.degrees(np.arcsin(turn)) / (way[j] - way[i]))
    return rms(metres), rms(degrees)


def at_wall(truth, clouds):
    """The median distance to a gable's plane, of the points that the true poses carry to within NEAR_M of one."""
    if not clouds:
        return None
    distances = []
    for pose, points in zip(truth[::10], clouds):
        x, y, z = (points @ pose[:3, :3].T + pose[:3, 3]).T
        off = np.min([np.abs(x - gable) for gable in GABLES_X_M], axis=0)
        near = (off < NEAR_M) & (y > GABLE_Y_M[0]) & (y < GABLE_Y_M[1]) & (z > GABLE_Z_M[0]) & (z < GABLE_Z_M[1])
        distances.append(off[near])
    return float(np.median(np.concatenate(distances)))


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


Result = collections.namedtuple("Result", "device noisy case part stamps truth fitted errors rmse drift turn wall")


def judge(device, noisy, case, stamps, estimate, clouds, parts):
    names = ["start", "middle", "end"] if case == SKEWED else ["end"]
    results = []
    for part in names:
        truth = parts[part]
        positions = fitted(truth, estimate)
        errors = np.linalg.norm(positions - truth[:, :3, 3], axis=1)
        drift, turn = relative(truth, estimate)
        wall = at_wall(truth, clouds)
        results.append(Result(device, noisy, case, part, stamps, truth, positions, errors, rms(errors), drift, turn, wall))
    return min(results, key=lambda result: result.rmse)


def drive(beamcast, device, noisy, sequence):
    """The results of all cases of a sensor, or of those of the short drive."""
    results = []
    with tempfile.TemporaryDirectory() as scratch:
        bags = {}
        for case, (cloud_time, find) in CASES.items():
            if sequence and case not in SHORT_CASES:
                continue
            if cloud_time not in bags:
                bags[cloud_time] = scan(beamcast, pathlib.Path(scratch) / cloud_time, device, cloud_time, noisy, sequence)
            bag = bags[cloud_time]
            stamps, estimate, clouds = find(bag)
            parts = at_parts(true_poses(bag), stamps, cloud_time == "end")
            results.append(judge(device.name, noisy, case, stamps, estimate, clouds, parts))
            print(f"{device.name}, {'noisy' if noisy else 'ideal'}, {case}: {results[-1].rmse:.3f} m", file=sys.stderr)
    return results


def table(results):
    lines = [
        "| sensor | noise | clouds | time | absolute error, m | most, m | relative error, % | turn, °/m | at a wall, m |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for r in results:
        noise = "noisy" if r.noisy else "ideal"
        # Odometries keep the clouds that they deskew.
        wall = "" if r.wall is None or "deskewed by KISS-ICP" in r.case else f"{r.wall:.2g}"
        numbers = f"{r.rmse:.3f} | {r.errors.max():.3f} | {100.0 * r.drift:.2f} | {r.turn:.3f} | {wall}"
        lines.append(f"| {r.device} | {noise} | {r.case} | {r.part} | {numbers} |")
    return "\n".join(lines)


def figure(results, path):
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    colours = dict(zip(CASES, ["tab:blue", "tab:green", "tab:red", "tab:purple", "tab:orange"]))
    names = list(dict.fromkeys(r.device for r in results))
    style = {"sharex": "row", "sharey": "row", "layout": "constrained", "squeeze": False}
    pictures, axes = pyplot.subplots(2, len(names), figsize=(6 * len(names), 7), **style)
    for column, name in zip(axes.T, names):
        chosen = [r for r in results if r.device == name and not r.noisy]
        above, below = column
        above.plot(chosen[0].truth[:, 0, 3], chosen[0].truth[:, 1, 3], color="black", linewidth=4, alpha=0.3, label="truth")
        for r in chosen:
            above.plot(r.fitted[:, 0], r.fitted[:, 1], color=colours[r.case], linewidth=1, label=r.case)
            below.semilogy((r.stamps - r.stamps[0]) / 1e9, r.errors, color=colours[r.case], linewidth=1)
        above.set(title=f"{name}, ideal, from above", xlabel="x, m", ylabel="y, m (stretched)")
        below.set(xlabel="time, s", ylabel="error of the position, m", ylim=(1e-3, None))
        below.grid(alpha=0.3)
    axes[0][0].legend(fontsize="small")
    pictures.savefig(path, dpi=80)


def failures(results, least_ratio):
    for r in results:
        most = MOST_M[r.device].get(r.case)
        if not r.noisy and most is not None and not r.rmse <= most:
            yield f"{r.device}, {r.case}: {r.rmse:.3f} m off; at most {most} m were expected"
        if r.noisy or r.case != IDEAL:
            continue
        if not r.wall <= MOST_AT_WALL_M:  # also if no point was there
            yield f"{r.device}: deskewed points are {r.wall:.1e} m off a wall; at most {MOST_AT_WALL_M} m were expected"
        skewed = next(s for s in results if (s.device, s.noisy, s.case) == (r.device, False, SKEWED))
        if skewed.rmse < least_ratio * r.rmse:
            yield f"{r.device}: raw clouds give {skewed.rmse:.3f} m, less than {least_ratio} times the {r.rmse:.3f} m without skew"
        if not skewed.wall >= LEAST_AT_WALL_RAW_M:
            yield f"{r.device}: raw points are {skewed.wall:.1e} m off a wall; at least {LEAST_AT_WALL_RAW_M} m were expected"


def check_loop():
    """loop.csv is what loop.py writes, but for the last digit: sines differ between platforms."""
    rows = np.loadtxt(HERE / "loop.csv", delimiter=",", skiprows=1)
    assert np.allclose(rows, list(loop.poses()), rtol=0.0, atol=2e-6), "loop.csv is not what loop.py writes"


def main():
    options = argparse.ArgumentParser()
    options.add_argument("beamcast", type=pathlib.Path)
    options.add_argument("--short", action="store_true")
    options.add_argument("--figure", type=pathlib.Path)
    options = options.parse_args()

    check_loop()
    devices, noises, sequence = (DEVICES[1:], [False], SHORT) if options.short else (DEVICES, [False, True], {})
    runs = [(options.beamcast.resolve(), device, noisy, sequence) for device in devices for noisy in noises]
    with concurrent.futures.ProcessPoolExecutor(max_workers=4) as pool:
        results = [result for run in pool.map(drive, *zip(*runs)) for result in run]
    print(table(results))
    if options.figure:
        figure(results, options.figure)
    wrong = list(failures(results, LEAST_RATIO_SHORT if options.short else LEAST_RATIO))
    if wrong:
        sys.exit("\n".join(wrong))


if __name__ == "__main__":
    main()
