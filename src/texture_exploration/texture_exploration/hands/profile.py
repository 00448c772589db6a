"""A profile: motors, control table, scales and fingers of a Dynamixel hand, from one YAML file (config/hands)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidParameter, TextureError
from texture_core.plain_data import load_yaml
from texture_core.resources import find_file
from texture_exploration.hands.models import MODELS, X_SERIES, describe, differs
from texture_exploration.hands.protocol import FingerSet

ROLES = ('press', 'across', 'along')
REGISTERS = (
    'operating_mode',
    'current_limit',
    'torque_enable',
    'hardware_error',
    'position_d',
    'position_i',
    'position_p',
    'bus_watchdog',
    'goal_current',
    'goal_position',
    'present_current',
    'present_velocity',
    'present_position',
)
WATCHDOG_UNIT_S, MAX_WATCHDOG = 0.02, 127  # the register counts by these
# Lowest and highest of every number: what motors of this kind have, with room. A number beyond is a slip of the pen,
# and the motors would press with it.
RANGES: Mapping[str, tuple[float, float]] = {
    'model': (0, 65535),
    'baud': (9600, 4_500_000),
    'rate_hz': (1.0, 1000.0),
    'operating_mode': (5, 5),  # current-based position: in any other the current does not bound the force
    'gain': (0, 16383),
    'position_rad': (1e-5, 0.1),
    'zero': (-1_048_575, 1_048_575),
    'velocity_rad_s': (1e-5, 1.0),
    'current_a': (1e-5, 0.1),
    'torque_nm_a': (0.01, 100.0),
    'idle_a': (0.0, 0.5),
    'move_a': (0.001, 5.0),
    'lever_m': (0.001, 1.0),  # of either sign
    'start_height_m': (0.0, 1.0),
    'id': (0, 252),
    'address': (0, 2047),
}
SIZES = (1, 2, 4)  # bytes of a register


@dataclass(frozen=True)
class Joint:
    """One motor of a finger: the fingertip moves `lever_m` per rad, linearised around the pose at the start."""

    id: int
    lever_m: float


@dataclass(frozen=True)
class Profile:
    """What a profile file says; registers are (address, bytes).

    `watchdog_s` is how long the motors go on without hearing anything; 0: for ever.
    """

    name: str
    models: tuple[int, ...]
    baud: int
    rate_hz: float
    operating_mode: int
    gains: Mapping[str, int]
    position_rad: float
    zero: int
    velocity_rad_s: float
    current_a: float
    torque_nm_a: float
    idle_a: float
    move_a: float
    table: Mapping[str, tuple[int, int]]
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
    def watchdog(self) -> int:
        """What the register of the Bus Watchdog is set to."""
        return round(self.watchdog_s / WATCHDOG_UNIT_S)

    def owner(self, motor: int) -> str:
        """Return what a motor does, in words."""
        for name, finger in self.fingers.items():
            for role, joint in finger.items():
                if joint.id == motor:
                    return f"motor {motor} ('{role}' of {name})"
        return f'motor {motor}'


def load_profile(name_or_path: str) -> Profile:
    """Return a profile that the package ships, or of a file.

    Raises
    ------
    UnknownName, InvalidParameter
        With the nearest name, or what is missing in the file.
    """
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
    """Return the profile in what a file holds; raises as `load_profile`.

    Parameters
    ----------
    content
        Content of the file.
    name
        Name of the profile, for the sentences of errors.

    Raises
    ------
    InvalidParameter
        If a register is missing, or a finger, role or number does not fit.
    """
    where = f"hand profile '{name}'"
    missing = [register for register in REGISTERS if register not in content['table']]
    if missing:
        raise InvalidParameter(f'{where}: the table lacks {", ".join(missing)}')
    fingers = {finger: _joints(roles, f'{where}, {finger}') for finger, roles in content['fingers'].items()}
    sets = {key: FingerSet(tuple(one['hold']), tuple(one['slide'])) for key, one in content['finger_sets'].items()}
    for one in sets.values():
        for finger in (*one.hold, *one.slide):
            if finger not in fingers:
                raise InvalidParameter(f'{where}: {unknown_name(finger, fingers, "finger")}')
    scales = content['scales']
    profile = Profile(
        name=name,
        models=tuple(content['models']),
        baud=int(content['baud']),
        rate_hz=float(content['rate_hz']),
        operating_mode=int(content['operating_mode']),
        gains={register: int(value) for register, value in content['gains'].items()},
        position_rad=float(scales['position_rad']),
        zero=int(scales['zero']),
        velocity_rad_s=float(scales['velocity_rad_s']),
        current_a=float(scales['current_a']),
        torque_nm_a=float(content['torque_nm_a']),
        idle_a=float(content['idle_a']),
        move_a=float(content['move_a']),
        table={register: (int(place[0]), int(place[1])) for register, place in content['table'].items()},
        fingers=fingers,
        finger_sets=sets,
        start_height_m=float(content['start_height_m']),
        hold_pose=tuple(content.get('hold_pose', ())),
        watchdog_s=float(content.get('watchdog_s', Profile.watchdog_s)),
    )
    _check_numbers(profile, where)
    _check_models(profile, where)
    if profile.watchdog_s != 0 and not 1 <= profile.watchdog_s / WATCHDOG_UNIT_S <= MAX_WATCHDOG:
        raise InvalidParameter(
            f'{where}: watchdog_s is {profile.watchdog_s:g} s; allowed are {WATCHDOG_UNIT_S:g} to '
            f'{MAX_WATCHDOG * WATCHDOG_UNIT_S:g} s, and 0, with which the motors press on when nobody commands them'
        )
    if len(set(profile.ids)) != len(profile.ids):
        raise InvalidParameter(f'{where}: a motor is named twice; each has one place')
    return profile


def _check_numbers(profile: Profile, where: str) -> None:
    joints = [joint for finger in profile.fingers.values() for joint in finger.values()]
    numbers = [(name, getattr(profile, name)) for name in RANGES if hasattr(profile, name)]
    numbers += [('model', model) for model in profile.models] + [('gain', gain) for gain in profile.gains.values()]
    numbers += [('id', motor) for motor in profile.ids] + [('lever_m', abs(joint.lever_m)) for joint in joints]
    numbers += [('address', address) for address, _ in profile.table.values()]
    for name, number in numbers:
        low, high = RANGES[name]
        if not low <= number <= high:  # so is NaN
            raise InvalidParameter(f'{where}: {name} is {number:g}; allowed are {low:g} to {high:g}')
    for register, (_, size) in profile.table.items():
        if size not in SIZES:
            raise InvalidParameter(f"{where}: register '{register}' has {size} bytes; 1, 2 or 4 are possible")


def _check_models(profile: Profile, where: str) -> None:
    """Refuse motors for which the torque of the profile is wrong: they would press harder or softer than asked."""
    for model in profile.models:
        for register, place in profile.table.items():
            if model in MODELS and place != X_SERIES.get(register, place):
                raise InvalidParameter(
                    f"{where}: '{register}' stands at {list(place)} in the table; motors of model {describe(model)} "
                    f'have it at {list(X_SERIES[register])}, and what protects would not be armed'
                )
        if difference := differs(model, profile.current_a, profile.torque_nm_a):
            raise InvalidParameter(
                f'{where}: {difference}; give each model a profile of its own, with its current_a and torque_nm_a'
            )


def _joints(roles: Mapping[str, Any], where: str) -> dict[str, Joint]:
    for role in roles:
        if role not in ROLES:
            raise InvalidParameter(f'{where}: {unknown_name(str(role), ROLES, "joint")}')
    if 'press' not in roles:
        raise InvalidParameter(f"{where}: no motor for 'press'; every finger needs one")
    return {role: Joint(int(one['id']), float(one['lever_m'])) for role, one in roles.items()}
