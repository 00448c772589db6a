# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Hands of Dynamixel motors: finger sets, profiles and models of force."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, get_type_hints

from texture_core.config import find_file, load_yaml, unknown_name
from texture_core.errors import InvalidParameter, TextureError

# --------------------
# Dynamixel models by number: current per count, and torque per current.
#
# Torque per current is stall torque by stall current at the recommended voltage. Source: ROBOTIS e-Manual, table
# Specifications and registers Model Number and Present Current of each model.


class MotorModel(NamedTuple):
    """Scale of the current in A per count, and torque per current in N·m/A."""

    name: str
    current_a: float
    torque_nm_a: float


MODELS: Mapping[int, MotorModel] = {
    1000: MotorModel('XH430-W350', 0.00134, 3.4 / 1.3),
    1010: MotorModel('XH430-W210', 0.00134, 2.5 / 1.3),
    1020: MotorModel('XM430-W350', 0.00269, 4.1 / 2.3),
    1030: MotorModel('XM430-W210', 0.00269, 3.0 / 2.3),
    1190: MotorModel('XL330-M077', 0.001, 0.215 / 1.47),
    1200: MotorModel('XL330-M288', 0.001, 0.52 / 1.47),
    1210: MotorModel('XC330-T181', 0.001, 0.76 / 0.80),
    1220: MotorModel('XC330-T288', 0.001, 0.92 / 0.80),
    1230: MotorModel('XC330-M181', 0.001, 0.60 / 1.80),
    1240: MotorModel('XC330-M288', 0.001, 0.93 / 1.80),
}
# Of all models above: address and bytes of the registers, and the scales of position and velocity. Source: the same,
# section Control Table.
X_SERIES: Mapping[str, tuple[int, int]] = {
    'operating_mode': (11, 1), 'current_limit': (38, 2), 'torque_enable': (64, 1), 'hardware_error': (70, 1),
    'position_d': (80, 2), 'position_i': (82, 2), 'position_p': (84, 2), 'bus_watchdog': (98, 1),
    'goal_current': (102, 2), 'goal_position': (116, 4), 'present_current': (126, 2), 'present_velocity': (128, 4),
    'present_position': (132, 4), 'firmware': (6, 1),
}  # fmt: skip
POSITION_RAD, ZERO = 0.001533981, 2048  # per count, and the counts of the middle position
VELOCITY_RAD_S = 0.0239691  # per count
TOLERANCE = 0.2  # of the torque of a count: motors of one model differ by less, and friction hides the rest

SIZE_330 = range(1190, 1250)
GOES_ON_TO = 51  # firmware of size 330 to this reports that the Bus Watchdog has tripped, and does not stop


def goes_on(model: int, firmware: int) -> bool:
    """Return whether a motor is known to move on after its Bus Watchdog has tripped.

    Source: forum.robotis.com, topic 4814 (in current control; other modes were not reported).
    """
    return model in SIZE_330 and firmware <= GOES_ON_TO


def describe(model: int) -> str:
    """Return a model number with the model's name, if it is in the table."""
    return f'{model} ({MODELS[model].name})' if model in MODELS else str(model)


# --------------------
# A hand holds with some fingers and moves others as an arm does.


class FingerSet(NamedTuple):
    """Which fingers hold the object, and which slide on it."""

    hold: tuple[str, ...]
    slide: tuple[str, ...]


# --------------------
# A profile: motors, torque and fingers of a Dynamixel hand, from one YAML file (config/hands).

ROLES = ('press', 'across', 'along')
WATCHDOG_UNIT_S, MAX_WATCHDOG = 0.02, 127  # the register counts by these
# Lowest and highest of every number: the range of these motors, with a margin. A number beyond is a typing error,
# and the motors would press with it.
RANGES: Mapping[str, tuple[float, float]] = {
    'baud': (9600, 4_500_000),
    'rate_hz': (1.0, 1000.0),
    'gain': (0, 16383),
    'torque_nm_a': (0.01, 100.0),
    'idle_a': (0.0, 0.5),
    'move_a': (0.001, 5.0),
    'lever_m': (0.001, 0.3),  # of either sign; no finger is longer
    'start_height_m': (0.0, 1.0),
    'id': (0, 252),
}


class Joint(NamedTuple):
    """One motor of a finger: the fingertip moves `lever_m` per rad, linearised around the pose at the start."""

    id: int
    lever_m: float


@dataclass(frozen=True)
class Profile:
    """Content of a profile file.

    `watchdog_s` is how long the motors continue without a message; 0: without limit.
    """

    name: str
    model: int
    baud: int
    rate_hz: float
    gains: Mapping[str, int]
    torque_nm_a: float
    idle_a: float
    move_a: float
    fingers: Mapping[str, Mapping[str, Joint]]
    finger_sets: Mapping[str, FingerSet]
    start_height_m: float
    hold_pose: tuple[int, ...] = field(default=())
    watchdog_s: float = 0.3

    @property
    def ids(self) -> tuple[int, ...]:
        """All motors."""
        moving = [joint.id for finger in self.fingers.values() for joint in finger.values()]
        return tuple(sorted((*moving, *self.hold_pose)))

    @property
    def current_a(self) -> float:
        """Current per count."""
        return MODELS[self.model].current_a

    @property
    def watchdog(self) -> int:
        """Value of the register of the Bus Watchdog."""
        return round(self.watchdog_s / WATCHDOG_UNIT_S)

    def owner(self, motor: int) -> str:
        """Return the role of a motor as text."""
        for name, finger in self.fingers.items():
            for role, joint in finger.items():
                if joint.id == motor:
                    return f"motor {motor} ('{role}' of {name})"
        return f'motor {motor}'


def load_profile(name_or_path: str) -> Profile:
    """Return a profile that the package ships, or of a file."""
    path = find_file(name_or_path, 'texture_exploration', 'config/hands', 'hand profile')
    try:
        return read_profile(load_yaml(path, 'hand profile'), path.stem)
    except TextureError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InvalidParameter(
            f"hand profile '{path.stem}' cannot be read ({type(error).__name__}: {error}); compare it with "
            'those of the package, in config/hands'
        ) from error


def read_profile(content: Mapping[str, Any], name: str) -> Profile:
    """Return the profile in the content of a file; raises as `load_profile`."""
    where = f"hand profile '{name}'"
    fingers = {finger: _joints(roles, f'{where}, {finger}') for finger, roles in content['fingers'].items()}
    sets = {key: FingerSet(tuple(one['hold']), tuple(one['slide'])) for key, one in content['finger_sets'].items()}
    for one in sets.values():
        for finger in (*one.hold, *one.slide):
            if finger not in fingers:
                raise InvalidParameter(f'{where}: {unknown_name(finger, fingers, "finger")}')
    kinds = get_type_hints(Profile)
    profile = Profile(
        name=name,
        model=content['model'],
        gains={register: int(value) for register, value in content['gains'].items()},
        fingers=fingers,
        finger_sets=sets,
        hold_pose=tuple(content.get('hold_pose', ())),
        watchdog_s=float(content.get('watchdog_s', Profile.watchdog_s)),
        **{number: kind(content[number]) for number, kind in kinds.items() if number in RANGES},
    )
    _check_model(profile, where)
    _check_numbers(profile, where)
    if profile.watchdog_s != 0 and not 1 <= profile.watchdog_s / WATCHDOG_UNIT_S <= MAX_WATCHDOG:
        raise InvalidParameter(
            f'{where}: watchdog_s is {profile.watchdog_s:g} s; allowed are {WATCHDOG_UNIT_S:g} to '
            f'{MAX_WATCHDOG * WATCHDOG_UNIT_S:g} s, and 0, with which the motors keep pressing without commands'
        )
    if len(set(profile.ids)) != len(profile.ids):
        raise InvalidParameter(f'{where}: a motor is named twice; each has one role')
    return profile


def _check_numbers(profile: Profile, where: str) -> None:
    joints = [joint for finger in profile.fingers.values() for joint in finger.values()]
    numbers = [(name, getattr(profile, name)) for name in RANGES if hasattr(profile, name)]
    numbers += [('gain', gain) for gain in profile.gains.values()]
    numbers += [('id', motor) for motor in profile.ids] + [('lever_m', abs(joint.lever_m)) for joint in joints]
    for name, number in numbers:
        low, high = RANGES[name]
        if not low <= number <= high:  # so is NaN
            raise InvalidParameter(f'{where}: {name} is {number:g}; allowed are {low:g} to {high:g}')


def _check_model(profile: Profile, where: str) -> None:
    """Refuse motors for which the torque of the profile is wrong: they would press harder or softer than requested."""
    if profile.model not in MODELS:
        raise InvalidParameter(
            f'{where}: model is {profile.model}; known are {", ".join(map(describe, MODELS))}, and another model has '
            'other registers and another torque'
        )
    expected_nm_a = MODELS[profile.model].torque_nm_a
    if abs(profile.torque_nm_a / expected_nm_a - 1) > TOLERANCE:
        raise InvalidParameter(
            f'{where}: model {describe(profile.model)} makes {expected_nm_a:.2f} N·m/A, and the profile says '
            f'{profile.torque_nm_a:g} N·m/A; correct its torque_nm_a or its model'
        )


def _joints(roles: Mapping[str, Any], where: str) -> dict[str, Joint]:
    for role in roles:
        if role not in ROLES:
            raise InvalidParameter(f'{where}: {unknown_name(str(role), ROLES, "joint")}')
    if 'press' not in roles:
        raise InvalidParameter(f"{where}: no motor for 'press'; every finger needs one")
    return {role: Joint(int(one['id']), float(one['lever_m'])) for role, one in roles.items()}
