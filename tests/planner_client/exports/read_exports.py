#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Reads every export of a plan with a parser of its own and checks it against plan.json.

read_exports.py FOLDER [LASER_DISTANCE_M]   FOLDER has plan.json and exports/. Poses are also made
from the nine parameters of every scan (docs/method.md), without any code of Sightline.
"""
import csv
import json
import math
import pathlib
import sys

import yaml

TOLERANCE = 1e-9


def multiply(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(len(b))) for j in range(len(b[0]))]
            for i in range(len(a))]


def of_quaternion(x, y, z, w):
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]


def about(axis, angle):
    c, s = math.cos(angle), math.sin(angle)
    return {'x': [[1, 0, 0], [0, c, -s], [0, s, c]],
            'y': [[c, 0, s], [0, 1, 0], [-s, 0, c]],
            'z': [[c, -s, 0], [s, c, 0], [0, 0, 1]]}[axis]


def of_rpy(roll, pitch, yaw):
    return multiply(about('z', yaw), multiply(about('y', pitch), about('x', roll)))


def rigid(rotation, translation):
    return [rotation[i] + [translation[i]] for i in range(3)] + [[0, 0, 0, 1]]


def close(a, b, what):
    for row_a, row_b in zip(a, b, strict=True):
        for value_a, value_b in zip(row_a, row_b, strict=True):
            if not abs(value_a - value_b) <= TOLERANCE:
                sys.exit(f'{what}: {value_a} instead of {value_b}')


def square(numbers):
    return [numbers[4 * i:4 * i + 4] for i in range(4)]


def looking_at_origin(distance, polar, azimuth):
    """Columns: x along the image rows, y down in the image, z towards the origin."""
    direction = (math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth),
                 math.cos(polar))
    z = [-d for d in direction]
    x = [-math.sin(azimuth), math.cos(azimuth), 0]
    y = [z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]]
    return rigid([[x[i], y[i], z[i]] for i in range(3)], [distance * d for d in direction])


def expected(scan, laser_distance):
    """Poses in the world: from plan.json's matrices, and camera and laser by the parameters."""
    start = scan.get('stage_start_m', 0)
    part = square(scan['part_pose']['matrix'])
    at_start = [row[:] for row in part]
    at_start[0][3] += start
    poses = {'camera': multiply(at_start, square(scan['camera_pose']['matrix'])),
             'laser': multiply(at_start, square(scan['laser_pose']['matrix'])),
             'part': part}
    value = scan['measurement'].get
    polar = math.radians(value('camera_polar_deg', 0))
    azimuth = math.radians(value('camera_azimuth_deg', 0))
    tau = math.radians(value('triangulation_angle_deg', 0))
    distance = value('camera_distance_m', 0)
    close(poses['camera'], looking_at_origin(distance, polar, azimuth), 'plan.json camera')
    close(poses['laser'], looking_at_origin(laser_distance or distance, polar - tau, azimuth),
          'plan.json laser')
    turn = multiply(about('z', math.radians(value('part_gamma_deg', 0))),
                    multiply(about('y', math.radians(value('part_beta_deg', 0))),
                             about('x', math.radians(value('part_alpha_deg', 0)))))
    close([row[:3] for row in part[:3]], turn, 'plan.json part')
    return poses


def main():
    folder = pathlib.Path(sys.argv[1])
    laser_distance = float(sys.argv[2]) if len(sys.argv) > 2 else None
    exports = folder / 'exports'
    scans = json.loads((folder / 'plan.json').read_text()).get('scans', [])
    frames = [expected(scan, laser_distance) for scan in scans]

    document = json.loads((exports / 'poses.json').read_text())
    assert len(document['scans']) == len(scans)
    for scan, poses, got in zip(scans, frames, document['scans'], strict=True):
        assert got['scan'] == scan['index']
        for name, pose in poses.items():
            assert got[name]['parent'] == 'world'
            close(square(got[name]['matrix']), pose, f'poses.json scan {got["scan"]} {name}')

    with open(exports / 'scans.csv', newline='') as file:
        rows = list(csv.DictReader(file))
    for scan, poses, row in zip(scans, frames, rows, strict=True):
        assert int(row['scan']) == scan['index']
        triggers = scan.get('trigger_positions_m', [])
        assert int(row['triggers_count']) == len(triggers)
        assert abs(float(row['stage_start_mm']) - 1e3 * scan.get('stage_start_m', 0)) < 1e-9
        assert abs(float(row['stage_end_mm']) - 1e3 * scan.get('stage_end_m', 0)) < 1e-9
        if len(triggers) > 1:
            pitch = 1e3 * (triggers[1] - triggers[0])
            assert abs(float(row['trigger_pitch_mm']) - pitch) < 1e-9
        for name, pose in poses.items():
            place = [float(row[f'{name}_{axis}_mm']) / 1e3 for axis in 'xyz']
            turn = of_quaternion(*(float(row[f'{name}_q{axis}']) for axis in 'xyzw'))
            close(rigid(turn, place), pose, f'scans.csv scan {row["scan"]} {name}')

    with open(exports / 'triggers.csv', newline='') as file:
        triggers = [(int(row['scan']), int(row['frame']), float(row['stage_position_mm']))
                    for row in csv.DictReader(file)]
    wanted = [(scan['index'], frame, 1e3 * place) for scan in scans
              for frame, place in enumerate(scan.get('trigger_positions_m', []))]
    for got, want in zip(triggers, wanted, strict=True):
        assert got[:2] == want[:2] and abs(got[2] - want[2]) < 1e-9, (got, want)

    def number(value):
        assert isinstance(value, (int, float)) and not isinstance(value, bool), repr(value)
        return float(value)

    def ros_pose(position, orientation):
        return rigid(of_quaternion(*(number(orientation[axis]) for axis in 'xyzw')),
                     [number(position[axis]) for axis in 'xyz'])

    array = yaml.safe_load((exports / 'camera_poses.yaml').read_text())
    assert set(array) == {'header', 'poses'} and array['header']['frame_id'] == 'world'
    for poses, got in zip(frames, array['poses'], strict=True):
        assert set(got) == {'position', 'orientation'}
        close(ros_pose(got['position'], got['orientation']), poses['camera'], 'camera_poses.yaml')

    transforms = yaml.safe_load((exports / 'transforms.yaml').read_text())['transforms']
    named = {entry['child_frame_id']: entry for entry in transforms}
    assert len(named) == len(transforms) == 3 * len(scans)
    for scan, poses in zip(scans, frames, strict=True):
        for name, pose in poses.items():
            entry = named[f'scan_{scan["index"]:02d}_{name}']
            assert entry['header']['frame_id'] == 'world'
            close(ros_pose(entry['transform']['translation'], entry['transform']['rotation']), pose,
                  'transforms.yaml')
            urdf = entry['urdf']
            close(rigid(of_rpy(*map(number, urdf['rpy'])), [number(v) for v in urdf['xyz']]), pose,
                  'transforms.yaml urdf')
    print(f'{len(scans)} scans agree')


main()
