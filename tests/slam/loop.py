"""The poses of tests/slam/loop.csv: the shipped drive goes on, to the end of the street, back, and round again.

    python tests/slam/loop.py > tests/slam/loop.csv

The first 11 s are configs/street_drive/ego.csv. Then the car leaves the crossing, turns by 180 degrees at either end of the street,
and comes past the crossing again: a minute in all, with a pose every 50 ms.
"""

import csv
import math
import pathlib

EGO = pathlib.Path(__file__).parents[2] / "configs/street_drive/ego.csv"
END_S = 71.0
FAST, SLOW = 8.0, 3.2  # m/s along the street, and in a turn
ACCELERATION, BRAKE = 1.5, 2.0  # m/s²
STEP_S = 0.001  # of the integration

# What the car does after metres of way from the crossing: to the side by metres (left is positive) within a length, or a turn
# to the left by 180 degrees within a length. A turn's curvature grows over the first fifth, stays, and falls over the last one.
TURN = 15.6
WAY = [
    (36.0, 24.0, "aside", -2.9),
    (61.0, TURN, "turn", None),
    (77.0, 13.0, "aside", 2.3),
    (220.0, 13.0, "aside", -3.1),
    (234.0, TURN, "turn", None),
    (250.0, 20.0, "aside", 1.9),
]


def ramp(u):
    """The share of a turn that is made when the share u of its length is behind: the integral of its curvature."""
    if u <= 0.2:
        return u * u / 0.32
    if u >= 0.8:
        return 1.0 - ramp(1.0 - u)
    return 0.125 + (u - 0.2) / 0.8


def heading(way):
    total = 0.0
    for start, length, kind, offset in WAY:
        u = min(max((way - start) / length, 0.0), 1.0)
        if kind == "turn":
            total += math.pi * ramp(u)
        else:
            # The slope offset/length · (1 - cos 2πu) goes aside by the offset if headings are small; larger ones fall short.
            total += math.atan(offset / length * (1.0 - math.cos(2.0 * math.pi * u)))
    return total


def limit(way):
    """The speed from which the next turn's can be reached."""
    speed = FAST
    for start, length, kind, _ in WAY:
        if kind == "turn" and way < start + length:
            speed = min(speed, math.sqrt(SLOW**2 + 2.0 * BRAKE * max(start - way, 0.0)))
    return speed


def poses():
    with EGO.open() as file:
        rows = [[float(value) for value in row.values()] for row in csv.DictReader(file)]
    yield from rows
    time, x, y = rows[-1][:3]
    way = speed = 0.0
    steps = round(0.05 / STEP_S)
    first = round(time / 0.05)
    for pose in range(first + 1, round(END_S / 0.05) + 1):
        for _ in range(steps):
            speed = min(speed + ACCELERATION * STEP_S, limit(way))
            middle = heading(way + 0.5 * speed * STEP_S)
            x += speed * STEP_S * math.cos(middle)
            y += speed * STEP_S * math.sin(middle)
            way += speed * STEP_S
        half = 0.5 * heading(way)
        yield [0.05 * pose, x, y, 0.0, 0.0, 0.0, math.sin(half), math.cos(half)]


def main():
    print("t_s,x_m,y_m,z_m,qx,qy,qz,qw")
    for t, x, y, _, _, _, qz, qw in poses():
        print(f"{t:.2f},{x:.6f},{y:.6f},0,0,0,{qz:.9f},{qw:.9f}")


if __name__ == "__main__":
    main()
