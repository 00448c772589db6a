"""What the robot part of an endurance run needs of the explorer beside explorations: its states, recover, reboot."""

from __future__ import annotations

import threading
import time

from std_srvs.srv import Trigger
from texture_msgs import msg

from texture_benchmarks.endurance.ros.listener import Listener
from texture_core.exploration import ExplorationState, Phase
from texture_core.ros.conversions import from_msg
from texture_core.ros.qos import STATE_QOS

POLL_S = 0.01


class RobotClient(Listener):
    """Listen to the states of the explorer in a thread of its own, and call its services; use it in a `with` block.

    Parameters
    ----------
    domain_id
        ROS domain.
    """

    def __init__(self, domain_id: int) -> None:
        self._slides_ns: dict[str, tuple[int, int]] = {}  # first and last stamp of the phase SLIDE, by exploration
        self._sliding = threading.Event()
        super().__init__('robot_client', domain_id, enable_rosout=False)
        node = self.node
        node.create_subscription(msg.ExplorationState, 'exploration', self._on_state, STATE_QOS)
        self._services = {name: node.create_client(Trigger, name) for name in ('recover', 'reboot')}

    def begin(self) -> None:
        """Wait for the next slide from now on."""
        self._sliding.clear()

    def wait_for_slide(self, cancelled: threading.Event, deadline_s: float) -> bool:
        """Return whether a slide began before `cancelled` was set or the deadline, s from now, was over."""
        end_s = time.monotonic() + deadline_s
        while not self._sliding.wait(POLL_S):
            if cancelled.is_set() or time.monotonic() > end_s:
                return False
        return True

    def slide_ns(self, exploration_id: str) -> tuple[int, int] | None:
        """Return the first and last time of the phase SLIDE on CLOCK_MONOTONIC; None if there was none."""
        return self._slides_ns.get(exploration_id)

    def call(self, service: str, deadline_s: float) -> tuple[bool, str]:
        """Call 'recover' or 'reboot'; return whether it succeeded, and its sentence."""
        client = self._services[service]
        end_s = time.monotonic() + deadline_s
        if not client.wait_for_service(deadline_s):
            return False, f"no service '{service}' within {deadline_s:g} s"
        future = client.call_async(Trigger.Request())
        while not future.done():
            if time.monotonic() > end_s:
                return False, f"no answer of '{service}' within {deadline_s:g} s"
            time.sleep(POLL_S)
        answer = future.result()
        return bool(answer.success), str(answer.message)

    def _on_state(self, message: msg.ExplorationState) -> None:
        state: ExplorationState = from_msg(message)
        if state.phase is not Phase.SLIDE:
            return
        # Stamps are of the clock of ROS; emulators stamp with CLOCK_MONOTONIC.
        time_ns = state.stamp_ns - (time.time_ns() - time.monotonic_ns())
        first_ns, _ = self._slides_ns.get(state.exploration_id, (time_ns, time_ns))
        self._slides_ns[state.exploration_id] = first_ns, time_ns
        self._sliding.set()
