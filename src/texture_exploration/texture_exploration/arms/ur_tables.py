"""Facts about controllers of Universal Robots.

Source: the RTDE guide and the dashboard guide of Universal Robots.
"""

from __future__ import annotations

from collections.abc import Mapping

RTDE_PORT = 30004
DASHBOARD_PORT = 29999
DASHBOARD_BANNER = 'Universal Robots Dashboard Server'
FIRST_WITHOUT_DASHBOARD = 10  # PolyScope X
FIRST_WITH_REMOTE_CONTROL = (5, 6)
# Oldest software by series: the oldest CB3 that ur-rtde 1.6.5 is tested with (its README); an e-Series with remote
# control; a PolyScope X that takes programs on the port where ur-rtde sends its own.
OLDEST: Mapping[int, tuple[int, int]] = {3: (3, 12), 5: (5, 6), 10: (10, 10)}
CB3 = 3  # the series without a force sensor in the flange
CONTROL_SCRIPT = 'rtde_control'  # the program of ur-rtde
# Which it obeys; one client only may write it. By whether the upper range is used (FLAG_UPPER_RANGE_REGISTERS).
COMMAND_REGISTERS: Mapping[bool, str] = {False: 'input_int_register_0', True: 'input_int_register_24'}

REQUEST_VERSION = 86  # 'V', types of RTDE messages
CONTROLLER_VERSION = 118  # 'v'
SETUP_OUTPUTS, SETUP_INPUTS, START, DATA = 79, 73, 83, 85
PROTOCOL_VERSION = 2

PROGRAM_STOPPED, PROGRAM_PLAYING = 1, 2  # runtime_state

# safety_mode -> why the arm cannot move; what is not listed lets it move
SAFETY_FAULTS: Mapping[int, str] = {
    3: 'protective stop',
    4: 'recovery mode',
    5: 'safeguard stop',
    6: 'emergency stop of the system',
    7: 'emergency stop of the robot',
    8: 'violation of a safety limit',
    9: 'fault of the safety system',
    10: 'a joint must be validated',
    11: 'undefined safety mode',
    12: 'safeguard stop of the automatic mode',
    13: 'three-position enabling stop',
}

# Force control about a fixed frame; the other axes may leave their path by so much: 0.1 m and 20°, as PolyScope does.
FORCE_FRAME_FIXED = 2
FORCE_DEVIATION_M = 0.1
FORCE_DEVIATION_RAD = 0.349
STOP_DECELERATION_M_S2 = 10.0  # the default of ur-rtde
