# SPDX-License-Identifier: Apache-2.0
"""Let the unmodified ur-rtde do all that it can with the emulated controller; print what came of it as JSON.

A process of its own, because its constructors cannot be interrupted: python ur_session.py IP.
"""

from __future__ import annotations

import json
import os
import sys
import time

from dashboard_client import DashboardClient
from rtde_control import RTDEControlInterface
from rtde_receive import RTDEReceiveInterface

DEADLINE_S = 5.0
PERIOD_S = 0.002
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
    home = receive.getActualTCPPose()

    def place():
        return receive.getActualTCPPose()[:3]

    def force():
        return receive.getActualTCPForce()[:3]

    done['offset'] = force()
    done['zeroed'] = [control.zeroFtSensor(), until(lambda: abs(force()[2]) < 0.2)]

    done['move'] = [control.moveL([home[0] + 0.02, *home[1:]], 0.25, 1.2), *place()]
    done['waypoint'] = control.getTargetWaypoint()[:3]
    done['background'] = [control.moveL(home, 0.02, 1.2, True), control.getAsyncOperationProgress(), control.isSteady()]
    control.stopL(10.0)
    done['stopped'] = [control.isSteady(), control.getAsyncOperationProgress() < 0, place()[0]]

    control.moveL(home, 0.25, 1.2)
    begin_s = time.monotonic()
    while time.monotonic() < begin_s + 0.6:
        cycle = control.initPeriod()
        control.servoL([*home[:2], home[2] + 0.01, 0, 0, 0], 0.5, 0.5, PERIOD_S, 0.05, 300)
        control.waitPeriod(cycle)
    done['servo'] = [control.servoStop(), *place()]

    done['contact'] = [control.moveUntilContact([0, 0, -0.05, 0, 0, 0]), *place()]
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

    control.moveL(home, 0.25, 1.2)
    control.startContactDetection([0, 0, -1, 0, 0, 0])
    done['detection'] = [control.readContactDetection()]
    control.moveL([*home[:2], home[2] - 0.03, 0, 0, 0], 0.05, 1.2, True)
    done['detection'] += [until(control.readContactDetection), control.stopContactDetection()]

    done['watchdog'] = [control.setWatchdog(10.0)]
    for _ in range(60):
        control.kickWatchdog()
        time.sleep(0.01)
    done['watchdog'] += [control.isProgramRunning(), until(lambda: not control.isProgramRunning()), control.moveL(home)]
    done['again'] = [control.reuploadScript(), until(control.isProgramRunning), control.moveL(home)]

    control.triggerProtectiveStop()
    done['protective_stop'] = [until(receive.isProtectiveStopped), receive.getSafetyMode(), control.moveL(home)]
    dashboard = DashboardClient(ip)
    dashboard.connect()
    done['dashboard'] = [dashboard.polyscopeVersion(), dashboard.robotmode(), dashboard.safetystatus()]
    dashboard.unlockProtectiveStop()
    control.reuploadScript()
    done['unlocked'] = [until(control.isProgramRunning), control.moveL(home)]
    control.stopScript()
    done['script_stopped'] = until(lambda: not control.isProgramRunning())
    print(json.dumps(done), flush=True)
    os._exit(0)  # the interfaces would sleep


if __name__ == '__main__':
    main(sys.argv[1])
