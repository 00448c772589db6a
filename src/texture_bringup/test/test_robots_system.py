# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Each emulated robot as a user starts and uses it: the launch file, then `texture explore`."""

import math
import re

import numpy as np
import pytest

from texture_bringup import command
from texture_core import config as resources
from texture_evaluation.train import train_from_bags
from texture_simulation.offline import SlidePlan, write_simulated

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

SURFACE = 'ridge_2mm_deep'
LINEAR = ['linear_slide', '--speed', '0.05', '--distance', '0.05', '--direction']
CIRCULAR = ['circular', '--speed', '0.05', '--radius', '0.02', '--turns', '0.5', '--direction', '45']
IN_HAND = ['in_hand_sliding', '--speed', '0.02', '--duration', '2']

# A label other than the true one would tell that the signal is not that of the way the finger went. The model does not
# know circles: there only the evidence counts. Each arm makes every motion in the tests of texture_exploration; here
# each motion goes through all nodes once.
OTHER = {'ur': CIRCULAR, 'hand': IN_HAND}
ROBOTS = {'ur': 73, 'rails': 74, 'hand': 75, 'ros_controllers': 95}  # and the domain of its nodes
PATIENCE = {  # of the arm itself; the explorer would warn of a parameter that its arm has not
    'ur': {'watchdog_hz': 1.0, 'connect_timeout_s': 30.0},
    'ros_controllers': {'deadman_s': 1.5, 'connect_timeout_s': 30.0},
}
# Not the default of 1 N for arms whose approach is the slower the less force is wanted, as they may not be heard yet.
FORCES = {robot: ['--force', '5'] for robot in ('ur', 'ros_controllers')}


def patient_hand(out):
    """Return a profile of the emulated hand whose motors wait longer for a busy machine."""
    profile, path = resources.folder('texture_exploration', 'config/hands') / 'leap.yaml', out / 'leap.yaml'
    text = profile.read_text()
    assert 'watchdog_s: 0.3 ' in text
    path.write_text(text.replace('watchdog_s: 0.3 ', 'watchdog_s: 1.5 '))
    return path


# Emulated motors without inertia go in steps, and a busy machine delays them, which adds high frequencies that no
# simulated slide has. How strong the vibration is tells the ridges from glass all the same.
RECIPE = """
windows: {length_s: 0.5, hop_s: 0.1}
inputs: {signal: {features: [mean_log_bands: {bands: 4}]}}
learner: {discriminant: {shrinkage: 0.1}}
"""


@pytest.fixture(scope='module')
def model(tmp_path_factory):
    """Return a model of both surfaces at the forces and in the directions of the robots."""
    folder = tmp_path_factory.mktemp('ways')
    bags = [
        bag
        for seed, (force_n, direction_rad) in enumerate(((1.0, 0.0), (1.0, math.pi), (5.0, math.pi)))
        for bag in write_simulated(
            folder / str(seed),
            SlidePlan(slides=4, speed_m_s=0.05, force_n=force_n, slide_s=1.0, direction_rad=direction_rad),
            np.random.default_rng(seed),
            surfaces=('glass', SURFACE),
        )
    ]
    (folder / 'power.yaml').write_text(RECIPE)
    train_from_bags(str(folder / 'power.yaml'), bags, out=folder / 'model')
    return folder / 'model.npz'


@pytest.mark.parametrize('robot', ROBOTS)
def test_motions_on_an_emulated_robot_end_with_an_estimate(robot, launched, model, tmp_path, capsys):
    params = {'peak_speed_fraction': 5.0, 'mean_speed_fraction': 1.0, **PATIENCE.get(robot, {})}
    given = {'surface': SURFACE, 'model': model, 'recipe': model.with_name('power.yaml')}
    if robot == 'hand':
        given['profile'] = patient_hand(tmp_path)
    with launched(robot, ROBOTS[robot], tmp_path, params, **given) as launcher:
        launcher.operator()
        assert 'this has no effect' not in launcher.log.read_text()  # whatever a launch file gives is a parameter
        # Two directions in one call are the same on every robot; the rails approach fastest.
        directions = ['0', '180'] if robot == 'rails' else ['180']
        motions = [[*LINEAR, *directions], *(motion for name, motion in OTHER.items() if name == robot)]
        for motion in motions:
            code = command.main(['explore', *motion, *FORCES.get(robot, [])])
            reported = capsys.readouterr().out
            # So few slides accept nothing; the estimate is there all the same.
            assert code == 3, reported + launcher.log.read_text()
            found = re.findall(
                r'the motion was completed\ntexture: +(?:unknown \(nearest: )?(\w+), '
                r'confidence [\d.]+ after ([\d.]+) s',
                reported,
            )
            assert len(found) == (len(directions) if motion == motions[0] else 1), reported
            assert all(float(evidence_s) > 0.5 for _, evidence_s in found), reported
            if motion == motions[0]:
                assert {label for label, _ in found} == {SURFACE}, reported
