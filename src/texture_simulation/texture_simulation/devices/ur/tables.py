"""Facts about UR controllers and about the control script of ur-rtde.

Sources: the RTDE and dashboard guides of Universal Robots; the source of ur-rtde 1.6.5.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass

RTDE_PORT = 30004
DASHBOARD_PORT = 29999
SCRIPT_PORT = 30003


@dataclass(frozen=True)
class ControllerVersion:
    """What depends on the version of the control software."""

    numbers: tuple[int, int, int, int]
    rate_hz: float
    dashboard: bool  # PolyScope X, version 10, has none


VERSIONS: Mapping[str, ControllerVersion] = {
    '3.15': ControllerVersion((3, 15, 8, 0), 125.0, True),
    '5.12': ControllerVersion((5, 12, 0, 0), 500.0, True),
    '5.23': ControllerVersion((5, 23, 0, 0), 500.0, True),
    '10.10': ControllerVersion((10, 10, 0, 0), 500.0, False),
}


class RtdeMessage(enum.IntEnum):
    """Types of RTDE messages."""

    REQUEST_VERSION = 86
    CONTROLLER_VERSION = 118
    TEXT = 77
    DATA = 85
    SETUP_OUTPUTS = 79
    SETUP_INPUTS = 73
    START = 83
    PAUSE = 80


# RTDE type -> format of `struct`, big-endian
FORMATS: Mapping[str, str] = {
    'BOOL': 'B',
    'UINT8': 'B',
    'UINT32': 'I',
    'UINT64': 'Q',
    'INT32': 'i',
    'DOUBLE': 'd',
    'VECTOR3D': '3d',
    'VECTOR6D': '6d',
    'VECTOR6INT32': '6i',
    'VECTOR6UINT32': '6I',
}


class SafetyMode(enum.IntEnum):
    """RTDE variable safety_mode."""

    NORMAL = 1
    PROTECTIVE_STOP = 3


SAFETY_BITS: Mapping[SafetyMode, int] = {SafetyMode.NORMAL: 1 << 0, SafetyMode.PROTECTIVE_STOP: 1 << 2}
SAFETY_NAMES: Mapping[SafetyMode, str] = {SafetyMode.NORMAL: 'NORMAL', SafetyMode.PROTECTIVE_STOP: 'PROTECTIVE_STOP'}
ROBOT_RUNNING = 7  # robot_mode
PROGRAM_STOPPED, PROGRAM_PLAYING, PROGRAM_PAUSED = 1, 2, 4  # runtime_state
COMMAND_REGISTERS = (0, 24)  # input_int registers of the control script: of the lower range, of the upper one
CONTROL_SCRIPT = 'rtde_control'  # how the control script of ur-rtde calls itself
POWER_ON_BIT, PROGRAM_RUNNING_BIT = 1 << 0, 1 << 1  # robot_status_bits


class ScriptCommand(enum.IntEnum):
    """Numbers in input_int_register_0 that the control script obeys."""

    NONE = 0
    MOVE_L = 3
    FORCE_MODE = 6
    FORCE_MODE_STOP = 7
    ZERO_FT_SENSOR = 8
    SPEED_L = 10
    SPEED_STOP = 15
    SERVO_STOP = 16
    SERVO_L = 24
    TOOL_CONTACT = 25
    GET_STEPTIME = 26
    GET_TARGET_WAYPOINT = 28
    PROTECTIVE_STOP = 31
    STOP_L = 33
    SET_WATCHDOG = 35
    IS_POSE_WITHIN_SAFETY_LIMITS = 36
    IS_STEADY = 47
    MOVE_UNTIL_CONTACT = 51
    START_CONTACT_DETECTION = 62
    STOP_CONTACT_DETECTION = 63
    READ_CONTACT_DETECTION = 64
    STOP_SCRIPT = 255


# The script processes these in every cycle and stays ready; the client does not wait for them.
REALTIME = frozenset({6, 9, 10, 11, 24, 25, 26, 27, 38, 58, 66, 67, 68, 69, 70, 71})
# What the robot does for some time; a real controller may acknowledge it late.
SLOW = frozenset(
    {ScriptCommand.SPEED_STOP, ScriptCommand.FORCE_MODE_STOP, ScriptCommand.ZERO_FT_SENSOR, ScriptCommand.STOP_L}
)
READY, DONE = 1, 2  # output_int_register_0
