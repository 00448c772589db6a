"""See to it that connecting stops nobody else's program on a UR controller: ur-rtde stops whatever runs there."""

from __future__ import annotations

import time
from contextlib import closing

from texture_core.errors import DeviceError
from texture_exploration.arms.ur_probe import DashboardClient, claims_register, runtime_state
from texture_exploration.arms.ur_tables import (
    COMMAND_REGISTERS,
    CONTROL_SCRIPT,
    FIRST_WITHOUT_DASHBOARD,
    PROGRAM_STOPPED,
)

SAMPLE_PERIOD_S = 0.05
STOPPING_S = 2.0


def check_program(
    ip: str,
    version: tuple[int, int],
    timeout_s: float,
    *,
    take_over: bool,
    pause_is_ours: bool,
    patience_s: float,
    upper_range: bool = False,
) -> None:
    """Return if no program runs or pauses on the controller, or none that anybody needs.

    A stop by the safety system may pause the program of the connection before: `pause_is_ours`. A control script of
    ours whose process was killed is ended by its watchdog within `patience_s`; one that has none yet is known by its
    name and by nobody writing the register that it obeys: one of the upper range if `upper_range`.

    Parameters
    ----------
    ip
        Address of the controller.
    version
        Version of the controller, as `check_ready` gives it.
    timeout_s
        Longest time to wait for one answer.
    take_over
        Whether a program of others is stopped.
    pause_is_ours
        Whether a paused program is one that this connection started before.
    patience_s
        How long a running program may take to end by itself.
    upper_range
        Whether the registers of the upper range are used.

    Raises
    ------
    DeviceError
        If there is one and `take_over` does not allow to stop it.
    """
    end_s = time.monotonic() + patience_s
    while program := _program(ip, version, timeout_s):
        if take_over or (pause_is_ours and program.upper().startswith('PAUSED')):
            break
        if time.monotonic() > end_s:
            if _is_orphan(ip, program, timeout_s, COMMAND_REGISTERS[upper_range]):
                break
            raise DeviceError(
                f"another program is on the controller at {ip} ('{program}'), and connecting would stop it; stop it on "
                "the pendant, or set parameter 'take_over' to true"
            )
        time.sleep(SAMPLE_PERIOD_S)
    else:
        return
    _stop(ip, version, timeout_s)


def _program(ip: str, version: tuple[int, int], timeout_s: float) -> str:
    """Return what runs or pauses, as the controller says it; '' if nothing does."""
    if version[0] >= FIRST_WITHOUT_DASHBOARD:
        runtime = runtime_state(ip, timeout_s)
        return '' if runtime == PROGRAM_STOPPED else f'runtime state {runtime}'
    with closing(DashboardClient(ip, timeout_s)) as dashboard:
        running, state = dashboard.ask('running'), dashboard.ask('programState')
    return state if 'true' in running.lower() or not state.upper().startswith('STOPPED') else ''


def _is_orphan(ip: str, program: str, timeout_s: float, register: str) -> bool:
    return CONTROL_SCRIPT in program and claims_register(ip, register, timeout_s)


def _stop(ip: str, version: tuple[int, int], timeout_s: float) -> None:
    """Stop it by the dashboard; without one ur-rtde has to."""
    if version[0] >= FIRST_WITHOUT_DASHBOARD:
        return
    with closing(DashboardClient(ip, timeout_s)) as dashboard:
        dashboard.ask('stop')
    end_s = time.monotonic() + STOPPING_S
    while program := _program(ip, version, timeout_s):
        if time.monotonic() > end_s:
            raise DeviceError(
                f"the program on the controller at {ip} ('{program}') does not stop; stop it on the pendant"
            )
        time.sleep(SAMPLE_PERIOD_S)
