"""An arm of Universal Robots, reached through ur-rtde in a process of its own."""

from __future__ import annotations

import dataclasses
import importlib.util
import time
from collections.abc import Mapping, Sequence

from texture_core.errors import DeviceError
from texture_exploration.arms.protocol import ArmCommand, ArmState, ForceReading
from texture_exploration.arms.surface_frame import SurfaceFrame
from texture_exploration.arms.tangential_force import tangential_force_n
from texture_exploration.arms.ur_link import WorkerLink
from texture_exploration.arms.ur_messages import RECOVER, STOP, UrCommand, UrReport
from texture_exploration.arms.ur_params import UrArmParams
from texture_exploration.arms.ur_probe import check_ready, unlock_protective_stop
from texture_exploration.arms.ur_program import check_program
from texture_exploration.arms.ur_tables import CB3, SAFETY_FAULTS

BASE_FRAME_ID = 'base'  # as ur_robot_driver and UR's own description call it, without a prefix
STANDSTILL = ArmCommand()
RECOVERY_S = 6.0
POLL_S = 0.01
WATCHDOG_S = 0.5  # beside its period, until it has ended a program
UNSTEADY = (
    'its force sensor could not be zeroed: the force changed all the while the finger rose; see that nothing touches '
    "the finger, and raise 'zero_steady_n' above the noise of the sensor"
)


class UrArm:
    """The arm as the explorer uses it. Nothing here waits for the controller longer than it says.

    Parameters
    ----------
    params
        The arm, the surface and the supervision.
    """

    Params = UrArmParams
    force_reading = ForceReading.NOISY  # in double precision

    def __init__(self, params: UrArmParams = UrArmParams()) -> None:  # noqa: B008 (frozen)
        self._params = params
        self._frame = SurfaceFrame(params.surface_pose)
        self._link: WorkerLink | None = None
        self._series = 0  # of the controller that was connected last
        self._paused = False  # a stop by the safety system may have left our program paused

    def check(self) -> None:
        """Ask the controller whether its arm can move; no program is started, and no protective stop released.

        Raises
        ------
        DeviceError
            If it cannot be reached, or its arm cannot move.
        """
        check_ready(self._params.ip, self._params.probe_timeout_s, unlock=False)

    def connect(self) -> None:
        """Reach the controller and start its control program; release a protective stop if the parameters say so.

        Raises
        ------
        DeviceError
            If it cannot be reached, its arm cannot move, or a program of somebody else is there; see `take_over`.
        """
        self.close()
        if importlib.util.find_spec('rtde_control') is None:
            raise DeviceError(
                "the arm 'ur' needs the package ur-rtde, which is not installed here: 'pip install ur-rtde==1.6.5'; "
                'it exists for Python up to 3.12 on Linux with an x86-64 processor'
            )
        params = self._params
        version = check_ready(params.ip, params.probe_timeout_s, params.unlock_protective_stop)
        check_program(
            params.ip,
            version,
            params.probe_timeout_s,
            take_over=params.take_over,
            pause_is_ours=self._paused,
            patience_s=max(params.acknowledge_s, 1.0 / params.watchdog_hz) + WATCHDOG_S,
            upper_range=params.upper_range_registers,
        )
        link = WorkerLink(params)
        try:
            link.wait_for_report()
        except DeviceError:
            link.end()
            raise
        self._link, self._series = link, version[0]

    def warning(self) -> str:
        """Return in a sentence that the controller is a CB3, which only estimates forces; '' if it is another."""
        if self._series != CB3:
            return ''
        return (
            f'the controller at {self._params.ip} is a CB3, which estimates forces within about 10 N: what is pressed '
            'may be far from what is asked; use an e-Series, or a force sensor in the flange'
        )

    def close(self) -> None:
        """Stop and end the worker process."""
        link, self._link = self._link, None
        if link is not None:
            self._paused = link.report is not None and link.report.safety_mode in SAFETY_FAULTS
            link.end()

    def state(self) -> ArmState:
        """Return the newest state."""
        report = self._report()
        frame = self._frame
        velocity, force = frame.direction(report.velocity_m_s), frame.direction(report.force_n)
        return ArmState(
            time_ns=report.time_ns,
            position=frame.place(report.position_m),
            velocity=velocity,
            force_n=force[2],
            fault=self._fault(report),
            watchdog_s=report.watchdog_s,
            tangential_force_n=tangential_force_n(force, velocity),
            along_n=force[:2],
        )

    def command(self, command: ArmCommand) -> None:
        """Hand a command to the worker.

        The force sensor is zeroed in free air only, which a rise of `zero_rise_m` without a change of the force proves.
        As long as it has not been zeroed since the arm was connected or recovered, a command with a force lifts first.

        Raises
        ------
        CommandRefused
            If a number is not finite or out of its range; the arm stops.
        DeviceError
            If the arm cannot be reached.
        """
        self._params.check(command, self.stop)
        if command == STANDSTILL:
            self.stop()
            return
        normal_m_s = command.normal_m_s if command.force_n is None else 0.0
        velocity = self._frame.to_base((*command.tangential_m_s, normal_m_s))
        self._connected().send(UrCommand(time.monotonic_ns(), velocity, command.force_n).to_bytes())

    def stop(self) -> None:
        """Let the worker stop the arm."""
        self._connected().send(STOP)

    def recover(self) -> None:
        """Release a protective stop and start the control program again, without connecting again.

        Whoever calls this has made sure that the arm may move.

        Raises
        ------
        DeviceError
            If the controller does not allow it.
        """
        link = self._connected()
        if self._report().safety_mode in SAFETY_FAULTS:
            unlock_protective_stop(self._params.ip, self._params.probe_timeout_s)
        link.send(RECOVER)
        end_s = time.monotonic() + RECOVERY_S
        while fault := self._fault(self._report()):
            if time.monotonic() > end_s:
                raise DeviceError(f'the arm did not recover: {fault}; look at the pendant')
            time.sleep(POLL_S)

    @property
    def base_frame_id(self) -> str:
        """Name of the base frame on tf."""
        return BASE_FRAME_ID

    @property
    def surface_pose(self) -> tuple[float, ...]:
        """Pose of the surface in the base frame."""
        return self._params.surface_pose

    def move_surface(self, pose: Sequence[float]) -> None:
        """Let go, and take over another pose of the surface; it holds from the next connection on."""
        self.close()
        self._params = self._params.at_surface(pose)
        self._frame = SurfaceFrame(self._params.surface_pose)

    @property
    def worker_pid(self) -> int:
        """Number of the process that talks to the controller."""
        return self._connected().pid

    @property
    def zeroed(self) -> bool:
        """Whether the force sensor was zeroed since the arm was connected or recovered."""
        return self._report().zeroed

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals of this connection; see `texture_exploration.arms.ur_messages.Counts`."""
        return dataclasses.asdict(self._report().counts)

    def _connected(self) -> WorkerLink:
        if self._link is None:
            raise DeviceError('the arm is not connected; connect it first')
        return self._link

    def _report(self) -> UrReport:
        link = self._connected()
        link.check()
        assert link.report is not None
        return link.report

    def _fault(self, report: UrReport) -> str:
        if report.silent:
            return f'the controller is silent for more than {self._params.silence_s * 1e3:.0f} ms'
        if report.safety_mode in SAFETY_FAULTS:
            return SAFETY_FAULTS[report.safety_mode]
        if not report.playing:
            return 'its control program was stopped, by hand or by its watchdog'
        return UNSTEADY if report.unsteady else ''
