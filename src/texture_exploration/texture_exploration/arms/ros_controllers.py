# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""An arm that ROS drives: a twist controller, poses and wrenches on topics.

It commands velocities, and reads pose and force, over standard topics; the velocity loop of the suite controls the
force. This file knows no ROS: the topics are behind `ControllerTopics`.
"""

from __future__ import annotations

import importlib
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

from texture_core.errors import DeviceError
from texture_exploration.arms.arm import (
    STANDSTILL,
    ArmCommand,
    ArmState,
    SurfaceArm,
    Vector,
    give_up_when_ending,
)
from texture_exploration.arms.tool_state import (
    HEARTBEAT_S,
    REST,
    FollowWatch,
    ForceSample,
    PoseSample,
    RosControllersParams,
    ToolState,
)
from texture_exploration.force_control import ForceLoop
from texture_exploration.guards import GAP_NS, Listening


class ControllerTopics(Protocol):
    """The topics of the controllers; `texture_exploration.ros.controllers` makes them."""

    def newest_pose(self) -> PoseSample | None:
        """Return the newest pose that came since the last call, None if none did."""

    def newest_force(self) -> ForceSample | None:
        """Return the newest force that came since the last call, None if none did."""

    def listeners(self) -> int:
        """Return the number of subscribers to the commanded velocities."""

    def unsafe(self) -> str:
        """Return why a motion must end although the arm obeys: another commands it, or no guard would stop it."""

    def beat(self, *, moving: bool) -> None:
        """Send the guard, in each period, a heartbeat and whether the arm may still move."""

    def send_velocity(self, velocity_m_s: Vector) -> None:
        """Command a velocity in the frame `twist_frame_id`."""

    def close(self) -> None:
        """Wait until what was sent has arrived, and leave; the guard stays until an arm that may still move rests."""


COMMAND_HOLDS_S = 0.1  # without a new one, after which the arm stops: ten periods of the explorer
RESTS_WITHIN_NS = 2_000_000_000  # of zero velocity; an arm that still moves is moved by others
GONE_NS = 300_000_000  # a controller that is not seen for this long is lost; a shorter gap may be due to discovery
UNSEEN_NS = 100_000_000  # without a pose, after which it is not known whether the arm follows
POLL_S = 0.005
LOGGER = logging.getLogger(__name__)
NOT_FOUND = '; check the name, that its node runs, ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE'
NOT_CONNECTED = 'the arm is not connected; connect it first'
DEFAULTS = RosControllersParams()


def open_topics(params: RosControllersParams) -> ControllerTopics:
    """Return the topics over ROS."""
    try:
        module = importlib.import_module('texture_exploration.ros.controllers')
    except ImportError as error:
        raise DeviceError(
            f"the arm 'ros_controllers' needs ROS 2, which is not installed here ({error}); see docs/index.md"
        ) from error
    topics: ControllerTopics = module.RosTopics(params)
    return topics


class RosControllersArm(SurfaceArm):
    """An arm that ROS drives by a Cartesian velocity controller.

    Zero velocity is commanded at every end: a stop, a fault, a command that is too old, `close`, and by a guard
    process if this one is killed; and always until the pose shows rest. After a connection, and after each silence
    of poses, forces or the controller, it is commanded first, before any other command.

    Parameters
    ----------
    params
        Topics, frames, force control and supervision.
    clock
        CLOCK_MONOTONIC in ns.
    open_topics
        Makes the topics when connecting.
    own_thread
        Command in a thread at `rate_hz` once connected. If False, the owner of the arm calls `step`.
    """

    Params = RosControllersParams
    noisy_force = True
    _params: RosControllersParams

    def __init__(
        self,
        params: RosControllersParams = DEFAULTS,
        clock: Callable[[], int] = time.monotonic_ns,
        open_topics: Callable[[RosControllersParams], ControllerTopics] = open_topics,
        own_thread: bool = True,
    ) -> None:
        super().__init__(params)
        self._clock = clock
        self._open_topics = open_topics
        self._own_thread = own_thread
        self._topics: ControllerTopics | None = None
        self._thread: threading.Thread | None = None
        self._closing = threading.Event()
        self._restart()

    def _restart(self) -> None:
        params = self._params
        loop = replace(params, loop_delay_s=min(0.1, params.loop_delay_s + params.force_smoothing_s))
        self._tool = ToolState(params)
        self._loop = ForceLoop(loop, 1.0 / params.rate_hz)
        self._follow = FollowWatch()
        self._state = self._tool.state('')
        self._command: tuple[ArmCommand, int] | None = None  # and when it came
        self._commanded: Vector = REST
        self._sent_ns = self._gone_ns = self._halted_ns = 0
        self._zeroed = False
        self._resting_first = True
        self._unsafe = ''  # why it may only be lifted, until it is connected again
        self._lost = ''  # a fault that stays as long
        self._failed = ''  # with an internal error

    def check(self) -> None:
        """Wait for the first pose, the first force and a controller that subscribes; nothing is commanded.

        Raises
        ------
        DeviceError
            If one of them does not come within `connect_timeout_s`; it names which.
        """
        self._reached().close()

    def connect(self) -> None:
        """Wait for the first pose, the first force and a controller that subscribes, and begin to command.

        Raises
        ------
        DeviceError
            If one of them does not come within `connect_timeout_s`; it names which.
        """
        topics = self._reached()
        self._closing.clear()
        self._topics = topics
        if self._own_thread:
            self._thread = threading.Thread(target=self._run, name='ros_controllers', daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Command zero velocity, and leave the topics."""
        self._command = None
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        topics, self._topics = self._topics, None
        if topics is not None:
            topics.send_velocity(REST)
            topics.beat(moving=not self._tool.rest.at_rest)
            topics.close()

    def state(self) -> ArmState:
        """Return the newest state.

        Raises
        ------
        DeviceError
            If the thread that commands the arm has ended.
        """
        self._connected()
        if self._thread is not None and not self._thread.is_alive():
            raise DeviceError('the thread that commands the arm has ended through an internal error; see the log')
        return self._state

    def command(self, command: ArmCommand) -> None:
        """Follow a command from the next period on.

        The force sensor is zeroed in free air only, at rest after a rise of 3 mm without a change of the force.

        Raises
        ------
        CommandRefused
            If a number is not finite or out of its range, or a force is wanted before the force sensor was zeroed since
            the arm was connected or in a fault; the arm stops.
        DeviceError
            If the arm is not connected.
        """
        self._connected()
        self._check(command)
        self._command = (command, self._clock())

    def stop(self) -> None:
        """Command zero velocity from the next period on."""
        self._command = None

    @property
    def base_frame_id(self) -> str:
        """Name of the base frame on tf."""
        return self._params.base_frame_id

    @property
    def zeroed(self) -> bool:
        """Whether the force sensor was zeroed since the arm was connected."""
        return self._zeroed

    def step(self) -> None:
        """Take what was measured, and send what the newest command needs now; zero velocity if that fails.

        After a first error the arm may only be lifted; one that comes again leaves it at rest for good.
        """
        topics = self._connected()
        try:
            self._step(topics)
        except Exception as error:
            LOGGER.exception('a step of the arm failed')
            reason = f'internal error, {type(error).__name__}: {error}'[:200]
            self._lost = self._lost or (self._failed and reason)
            self._failed = self._unsafe = reason
            self._command = None
            self._commanded = REST
            topics.send_velocity(REST)
            self._state = replace(self._state, unsafe=reason, fault=self._lost)

    def _step(self, topics: ControllerTopics) -> None:
        """Take what was measured, and send what the newest command needs now."""
        now_ns = self._clock()
        held_s = (now_ns - self._sent_ns) * 1e-9 if self._sent_ns else 0.0
        if self._sent_ns and now_ns - self._sent_ns > GAP_NS:
            self._tool.listening = Listening(gap_start_ns=self._sent_ns, gap_end_ns=now_ns)
        self._sent_ns = now_ns
        self._take(topics, now_ns)
        if not self._lost:
            self._lost = self._lost_controller(topics, now_ns, held_s) or self._restless(now_ns, held_s)
        self._unsafe = self._unsafe or self._tool.garbled or topics.unsafe()
        fault = self._fault(now_ns)
        if fault:
            self._command = None
            self._tool.zero.forget()
            if fault != self._state.fault:  # once for one that stays, again and again as long as nothing comes
                self._let_rest()
        self._state = replace(self._tool.state(fault), unsafe=self._unsafe)
        self._zeroed = self._tool.zero.zeroed  # after the state, so that a reader finds the zeroed force
        self._carry_out(topics, self._due(now_ns), held_s)
        self._state = replace(self._state, unsafe=self._unsafe or self._loop.doubt)
        topics.beat(moving=not self._tool.rest.at_rest)

    def _reached(self) -> ControllerTopics:
        """Close an earlier connection; return the topics of a new one, once all is there."""
        self.close()
        self._restart()
        topics = self._open_topics(self._params)
        try:
            self._wait_for_controllers(topics)
        except BaseException:
            topics.close()
            raise
        return topics

    def warning(self) -> str:
        """Return in a sentence that clocks do not agree, '' if they do."""
        return self._tool.skew

    def _connected(self) -> ControllerTopics:
        if self._topics is None:
            raise DeviceError(NOT_CONNECTED)
        return self._topics

    def _wait_for_controllers(self, topics: ControllerTopics) -> None:
        params, tool = self._params, self._tool
        end_s = time.monotonic() + params.connect_timeout_s
        while True:
            give_up_when_ending()
            self._take(topics, self._clock())
            missing = {
                f"no pose arrives on '{params.pose_topic}'": not tool.came_ns['pose'],
                f"no force arrives on '{params.wrench_topic}'": not tool.came_ns['force'],
                f"no node subscribes to '{params.twist_topic}'": topics.listeners() == 0,
            }
            faults = [what for what, is_missing in missing.items() if is_missing]
            if unsafe := topics.unsafe():
                faults.append(unsafe)
            faults += filter(None, (tool.late, tool.garbled))
            if not faults:
                self._state = tool.state('')
                return
            if tool.misplaced or time.monotonic() > end_s:
                raise DeviceError(tool.misplaced or f'{"; ".join(faults)}{NOT_FOUND}')
            time.sleep(POLL_S)

    def _take(self, topics: ControllerTopics, now_ns: int) -> None:
        """Take the new messages; the pose first, as the force is rotated by it."""
        pose = topics.newest_pose()
        if pose is not None:
            self._tool.take_pose(now_ns, pose)
        force = topics.newest_force()
        if force is not None and self._tool.came_ns['pose']:
            self._tool.take_force(now_ns, force, moving=self._commanded != REST)

    def _lost_controller(self, topics: ControllerTopics, now_ns: int, held_s: float) -> str:
        """Return in a sentence that the controller is lost, '' if it is not."""
        topic = self._params.twist_topic
        if topics.listeners() == 0:
            self._gone_ns = self._gone_ns or now_ns
            if now_ns - self._gone_ns > GONE_NS:
                return f"no node subscribes to '{topic}' any more: the controller has ended"
            self._unsafe = self._unsafe or f"for a moment no node subscribed to '{topic}'; see its controller"
            self._follow.restart()
            self._let_rest()
            return ''
        self._gone_ns = 0
        # The guard has commanded zero meanwhile; or the arm was not observed, as its controller had no time.
        unseen = now_ns - self._tool.came_ns['pose'] > UNSEEN_NS
        if self._commanded == REST or held_s > HEARTBEAT_S or unseen:
            self._follow.restart()
            return ''
        late = self._follow.update(now_ns, self._tool.state('').position, self._commanded, held_s)
        if not late:
            return ''
        reason = f"{late}: the controller on '{topic}' is not active or holds back, or something is in the way"
        if self._unsafe or not self._follow.at_rest:  # nor did it follow the lift, or its motion is unknown
            return reason
        self._unsafe = reason  # it may only have been delayed: a lift is tried
        return ''

    def _let_rest(self) -> None:
        """Bring the arm to rest first: after a silence its motion is unknown."""
        self._tool.rest.forget()
        self._resting_first, self._halted_ns = True, 0

    def _restless(self, now_ns: int, held_s: float) -> str:
        """Return in a sentence that the arm moves although zero velocity is commanded, '' if it does not."""
        excused = self._tool.rest.at_rest or self._commanded != REST
        if excused or held_s > HEARTBEAT_S or not self._halted_ns:
            self._halted_ns = now_ns
        if now_ns - self._halted_ns <= RESTS_WITHIN_NS:
            return ''
        return (
            f"the arm moves although zero velocity is commanded on '{self._params.twist_topic}': check what else moves "
            'it, or whether this topic leads to its controller'
        )

    def _fault(self, now_ns: int) -> str:
        tool = self._tool
        return self._lost or tool.misplaced or tool.late or tool.stale(now_ns)

    def _due(self, now_ns: int) -> ArmCommand | None:
        """Return the command that holds now, None if none does."""
        self._resting_first &= not self._tool.rest.at_rest
        command = self._command
        if command is None or self._resting_first or (now_ns - command[1]) * 1e-9 > COMMAND_HOLDS_S:
            return None
        if self._unsafe:  # only a lift is allowed
            up_m_s = 0.0 if command[0].force_n is not None else max(0.0, command[0].normal_m_s)
            return ArmCommand(normal_m_s=up_m_s)
        pressed = command[0].force_n is not None
        return command[0] if self._tool.zero.zeroed or not pressed else None

    def _carry_out(self, topics: ControllerTopics, command: ArmCommand | None, held_s: float) -> None:
        state = self._state
        if command is not None and command.force_n is not None:
            self._tool.zero.presume_contact()
        velocity = REST if state.fault else self._loop.velocity(command or STANDSTILL, state, held_s)
        if velocity != REST:
            self._tool.rest.forget()
        if not self._tool.rest.at_rest:
            self._send(topics, velocity)
        self._commanded = velocity

    def _send(self, topics: ControllerTopics, velocity: Vector) -> None:
        in_base = self._frame.to_base(velocity)
        if self._params.twist_frame_id == self._params.tool_frame_id:
            x, y, z = (self._tool.rotation.T @ in_base).tolist()
            in_base = (x, y, z)
        topics.send_velocity(in_base)

    def _run(self) -> None:
        topics = self._connected()
        period_s = 1.0 / self._params.rate_hz
        due_s = time.monotonic()
        try:
            while not self._closing.is_set():
                self.step()
                due_s = max(due_s + period_s, time.monotonic())  # missed periods are not repeated
                self._closing.wait(due_s - time.monotonic())
        finally:
            # Also when a bug ends the loop: no arm is left moving.
            topics.send_velocity(REST)
