# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Let the unmodified ur-rtde do all that the arm needs from it with the emulated controller; print the result as JSON.

A separate process, because its constructors cannot be interrupted: python ur_session.py IP.
"""

from __future__ import annotations

import json
import os
import socket
import sys
import time

from dashboard_client import DashboardClient
from rtde_control import RTDEControlInterface
from rtde_receive import RTDEReceiveInterface

DEADLINE_S = 5.0
FRAME = [0.0] * 6
NORMAL_ONLY = [0, 0, 1, 0, 0, 0]
LIMITS = [0.1, 0.1, 0.05, 0.3, 0.3, 0.3]


def until(condition):
    """Wait for a condition; return whether it came true."""
    end_s = time.monotonic() + DEADLINE_S
    while not condition():
        if time.monotonic() > end_s:
            return False
        time.sleep(0.005)
    return True


def main(ip):
    done = {}
    receive = RTDEReceiveInterface(ip)
    control = RTDEControlInterface(ip)

    def force():
        return receive.getActualTCPForce()[:3]

    done['offset'] = force()
    done['zeroed'] = [control.zeroFtSensor(), until(lambda: abs(force()[2]) < 0.2)]

    done['force_mode'] = [
        control.forceMode(FRAME, NORMAL_ONLY, [0, 0, -5.0, 0, 0, 0], 2, LIMITS),
        until(lambda: abs(force()[2] - 5.0) < 0.25),
    ]
    done['slide'] = [
        control.speedL([0.02, 0, 0, 0, 0, 0], 1.0),
        until(lambda: abs(receive.getActualTCPSpeed()[0] - 0.02) < 1e-6 and abs(force()[0] + 2.5) < 0.3),
        force()[2],
    ]
    done['stop'] = [control.speedStop(), control.forceModeStop(), until(lambda: not any(receive.getActualTCPSpeed()))]

    control.speedL([0, 0, 0.05, 0, 0, 0], 1.0)
    done['lifted'] = [until(lambda: abs(force()[2]) < 0.2), control.speedStop()]

    done['watchdog'] = [control.setWatchdog(10.0)]
    for _ in range(60):
        control.kickWatchdog()
        time.sleep(0.01)
    done['watchdog'] += [control.isProgramRunning(), until(lambda: not control.isProgramRunning()), control.speedStop()]
    done['again'] = [control.reuploadScript(), until(control.isProgramRunning), control.speedStop()]

    with socket.create_connection((ip, 29999)) as line:
        line.sendall(b'emulate protective stop\n')
        done['protective_stop'] = [until(receive.isProtectiveStopped), receive.getSafetyMode(), control.speedStop()]
    dashboard = DashboardClient(ip)
    dashboard.connect()
    done['dashboard'] = [dashboard.polyscopeVersion(), dashboard.robotmode(), dashboard.safetymode()]
    dashboard.unlockProtectiveStop()
    control.reuploadScript()
    done['unlocked'] = [until(control.isProgramRunning), control.speedStop()]
    control.stopScript()
    done['script_stopped'] = until(lambda: not control.isProgramRunning())
    print(json.dumps(done), flush=True)
    os._exit(0)  # the interfaces would sleep


if __name__ == '__main__':
    main(sys.argv[1])
