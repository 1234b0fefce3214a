"""Finds where a LiDAR is mounted, from one frame of its ranges and a model of the room: Gauss–Newton with `Frame.range_jacobian`.

    python calibrate.py [--noise 0.01]

The LiDAR's true mount is 1° and 5 cm off the drawing. Each step casts the room from the mount that is known so far, and solves J·ξ = measured − cast
for the small motion ξ of the sensor in its own frame that explains the difference best; the new mount is the old one times exp(ξ).
"""

import argparse
from pathlib import Path

import numpy as np

import beamcast

JOB = Path(__file__).parents[2] / "configs" / "room_vlp16.toml"


def motion(xi):
    """The motion (4, 4) of a translation in metres and a rotation vector in radians (6,): [exp(φ) | τ], by Rodrigues' formula."""
    angle = np.linalg.norm(xi[3:])
    x, y, z = xi[3:] / angle if angle > 0 else xi[3:]
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    matrix[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    matrix[:3, 3] = xi[:3]
    return matrix


def distance(a, b):
    """How far two mounts are apart: in metres, and in radians. The angle comes of its sine, which is exact where it is small."""
    difference = np.linalg.inv(a) @ b
    turn = difference[:3, :3] - difference[:3, :3].T
    return np.linalg.norm(difference[:3, 3]), np.arcsin(min(1, np.linalg.norm(turn) / np.sqrt(8)))


def cast(mount, numbers, job, sensor):
    """The frames of the job with the sensor at a mount (body_from_sensor)."""
    pose = {"matrix": mount, "convention": "body"}
    return list(beamcast.Job(job, {f"sensor.{sensor}.pose": pose}).frames(numbers, sensors=[sensor]))


def calibrate(measured, mount, numbers=(0,), job=JOB, sensor="vlp16", steps=12, say=lambda *_: None):
    """The mount (4, 4) that explains measured ranges, one image (rows, columns) a frame number, from a first guess of it."""
    for step in range(steps):
        frames = cast(mount, numbers, job, sensor)
        with np.errstate(invalid="ignore"):
            residuals = np.concatenate([(seen - frame["range_m"]).ravel() for seen, frame in zip(measured, frames)])
        jacobian = np.concatenate([frame.range_jacobian().reshape(-1, 6) for frame in frames])
        # A beam counts where both have a return (inf − inf is NaN) and where it does not graze its surface: |∂r/∂τ| is 1/cos of the angle of
        # incidence, and beyond 5 (78°) the first centimetres of the motion lead off the triangle. NaN is not less than 5.
        is_used = np.isfinite(residuals) & (np.linalg.norm(jacobian[:, :3], axis=1) < 5)
        residuals, jacobian = residuals[is_used], jacobian[is_used]
        # A beam that met another surface than now is no error of the mount. Cauchy's weights leave it out by and by: the scale is that of
        # most residuals (1.48 times their median is the deviation of a normal distribution).
        scale = 3 * 1.48 * np.median(np.abs(residuals)) + 1e-9
        weights = 1 / (1 + (residuals / scale) ** 2)
        xi, *_ = np.linalg.lstsq(jacobian * np.sqrt(weights)[:, None], residuals * np.sqrt(weights), rcond=None)
        mount = mount @ motion(xi)
        say(step, len(residuals), np.linalg.norm(xi))
        if np.linalg.norm(xi) < 1e-9:
            break
    return mount


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--noise", type=float, default=0.0, help="the standard deviation of the measured ranges, in metres")
    options = options.parse_args()
    drawn = np.eye(4)
    drawn[:3, 3] = [0, 0, 1.2]
    off = np.concatenate([0.05 * np.array([2, -1, 2]) / 3, np.radians(1) * np.array([1, 2, -2]) / 3])
    true = drawn @ motion(off)

    [measured] = cast(true, [0], JOB, "vlp16")
    noise = options.noise * np.random.default_rng(1).standard_normal(measured.shape)
    print("step  beams   |ξ|")
    found = calibrate([measured["range_m"] + noise], drawn, say=lambda *row: print("{:4} {:6} {:.1e}".format(*row)))
    for name, mount in (("drawn", drawn), ("found", found)):
        metres, radians = distance(true, mount)
        print(f"the mount as {name} is off by {metres:.2e} m and {radians:.2e} rad")


if __name__ == "__main__":
    main()
