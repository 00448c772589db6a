"""Dynamixel models by number: what a count of current is, and how much torque a current makes.

Torque per current is stall torque by stall current at the recommended voltage. Source: ROBOTIS e-Manual, table
Specifications and registers Model Number and Present Current of each model.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


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
# Address and bytes of the registers in all models above. Source: the same, section Control Table.
X_SERIES: Mapping[str, tuple[int, int]] = {
    'operating_mode': (11, 1), 'current_limit': (38, 2), 'torque_enable': (64, 1), 'hardware_error': (70, 1),
    'position_d': (80, 2), 'position_i': (82, 2), 'position_p': (84, 2), 'bus_watchdog': (98, 1),
    'goal_current': (102, 2), 'goal_position': (116, 4), 'present_current': (126, 2), 'present_velocity': (128, 4),
    'present_position': (132, 4),
}  # fmt: skip
TOLERANCE = 0.2  # of the torque of a count: motors of one model differ by less, and friction hides the rest

SIZE_330 = range(1190, 1250)
GOES_ON_TO = 51  # firmware of size 330 to this reports that the Bus Watchdog has tripped, and does not stop


def goes_on(model: int, firmware: int) -> bool:
    """Return whether a motor is known to move on after its Bus Watchdog has tripped.

    Source: forum.robotis.com, topic 4814 (in current control; other modes were not told).
    """
    return model in SIZE_330 and firmware <= GOES_ON_TO


def describe(model: int) -> str:
    """Return a model number with the model's name, if it is in the table."""
    return f'{model} ({MODELS[model].name})' if model in MODELS else str(model)


def differs(model: int, current_a: float, torque_nm_a: float) -> str:
    """Return how a model's torque per count departs from that of given scales, '' if it does not, or is unknown.

    Parameters
    ----------
    model
        Model number that the motor reports.
    current_a
        Current per count in the profile, A.
    torque_nm_a
        Torque per current in the profile, N·m/A.

    Returns
    -------
    str
        A sentence without a full stop, or ''.
    """
    if model not in MODELS:
        return ''
    own = MODELS[model]
    count_nm = own.current_a * own.torque_nm_a
    if abs(current_a * torque_nm_a / count_nm - 1) <= TOLERANCE:
        return ''
    return (
        f'model {describe(model)} makes {own.torque_nm_a:.2f} N·m/A at {own.current_a * 1000:g} mA per count, and the '
        f'profile says {torque_nm_a:g} N·m/A at {current_a * 1000:g} mA per count'
    )
