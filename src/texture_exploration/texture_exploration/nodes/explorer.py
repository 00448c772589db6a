# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Move the finger over the surface on request, and return the estimates."""

from __future__ import annotations

import contextlib
import copy
import itertools
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from rclpy._rclpy_pybind11 import RCLError
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from texture_msgs import action, msg, srv
from tf2_msgs.msg import TFMessage

from texture_core.config import find, param, parameters_of
from texture_core.errors import (
    ExplorationError,
    InvalidData,
    InvalidParameter,
    MotionRefused,
    TextureError,
    UnknownName,
)
from texture_core.ros import (
    ESTIMATE_QOS,
    SENSOR_QOS,
    STATE_QOS,
    DiagnosticReport,
    Diagnostics,
    PatientLifecycleNode,
    WaitingExecutor,
    check_names,
    declare,
    frame_name,
    from_msg,
    on_change,
    quality_of_service,
    run,
    to_msg,
)
from texture_core.types import ExplorationState, Phase, RoughnessEstimate, TextureEstimate, quaternion
from texture_exploration.arms.arm import ENDING
from texture_exploration.arms.catalogue import ARMS
from texture_exploration.exploration import (
    STILL_MOVING,
    Exploration,
    ExplorationOutcome,
    may_stop,
    new_id,
    no_signal_watch,
    refusal,
)
from texture_exploration.explorer import CONNECTING, NO_CONTROL, Explorer
from texture_exploration.guards import Listening, SignalWatch, SignalWatchParams
from texture_exploration.motions import DEFAULTS, MOTIONS
from texture_exploration.safety import SafetyLimits, SurfacePatch
from texture_exploration.touch import TouchParams

STATIC_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
FEEDBACK_PERIOD_S = 0.05
IDLE_PERIOD_S = 1.0
ESTIMATE_PERIOD_S = 0.005
STOP_COVERS_S = 0.2  # a request that comes so soon after a stop may have been sent before it
PRESSED = (
    'the force sensor shows {:.1f} N, so the finger may press, as after an explorer that was killed: `texture lift` '
    'lifts it now, and the first exploration does so'
)
SEVERAL = (
    'several explorers are in the ROS_DOMAIN_ID {} and namespace {}; a request would move all their arms: end the '
    'others, or give each a namespace. ROS forgets one that was killed after 20 s'
)
RESULT_KEPT_S = 60  # for a late client; rclpy's 15 min are hundreds of results


@dataclass(frozen=True)
class ExplorerParams:
    """The arm, when control of it is taken, and the frame of the surface."""

    arm: str = param('simulated', "Arm that carries the finger: a name of the catalogue, or a user's 'module:Class'.")
    autostart: bool = param(
        True,
        'Configures and activates the node at start-up, which takes control of the arm; false leaves that to a '
        'lifecycle manager.',
    )
    estimate_timeout_s: float = param(
        1.0, 'How long to wait for the final estimates after the lift; above 0.3 s.', unit='s', low=0.0, high=60.0
    )
    motions: str = param(
        '', "Motions of other packages that a request may name, as 'module:function', separated by spaces."
    )
    surface_frame_id: str = param(
        'surface',
        'Frame of the surface, in the headers of the published states and on /tf_static; in a namespace NAMESPACE/ is '
        'put before it.',
    )


Estimates = dict[str, TextureEstimate | RoughnessEstimate]  # the newest, by kind


def no_estimates(exploration_id: str) -> Estimates:
    """Return the estimates of an exploration before the first one came."""
    return {'texture': TextureEstimate(0, exploration_id), 'roughness': RoughnessEstimate(0, exploration_id)}


class ExplorerNode(PatientLifecycleNode):
    """Explore on request, as a service or as an action; publish the state of the finger.

    Configuring checks that the arm answers, activating takes control, deactivating lifts the finger and releases it.
    """

    owns_file = True  # limits in a misnamed section would be ignored

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('explorer', **kwargs)
        params = declare(self, ExplorerParams)
        self._estimate_timeout_s, self._autostart = params.estimate_timeout_s, params.autostart
        self._surface_frame_id = frame_name(self.get_namespace(), params.surface_frame_id)
        self._explorer = self._make_explorer(params)
        self._transforms = self.create_publisher(TFMessage, '/tf_static', STATIC_QOS)
        self._broadcast_surface()
        self._rng, self._numbers = np.random.default_rng(), itertools.count(1)
        self._open: dict[str, Estimates] = {}  # of explorations whose caller still waits, by id
        self._last_end, self._not_lifted = 'none', ''  # in sentences
        self._publishing = threading.Lock()
        self._closing = False
        self._states = self.create_publisher(msg.ExplorationState, 'exploration', STATE_QOS)
        self._infos = self.create_publisher(msg.ExplorerInfo, 'explorer_info', quality_of_service('explorer_info'))
        self._info, self._last_error, self._active = msg.ExplorerInfo(), ExplorationError.NONE, False
        self.create_subscription(msg.TextureEstimate, 'texture', self._on_estimate, ESTIMATE_QOS)
        self._model = msg.ModelInfo()
        self.create_subscription(
            msg.ModelInfo, 'model_info', partial(setattr, self, '_model'), quality_of_service('model_info')
        )
        self.create_subscription(msg.RoughnessEstimate, 'roughness', self._on_estimate, ESTIMATE_QOS)
        group = ReentrantCallbackGroup()  # a call that waits for an exploration must not block `stop`
        self.create_service(srv.Explore, 'explore', self._on_service, callback_group=group)
        self._offer('~/stop', self._stop, group)
        self._offer('~/recover', self._recover, group)
        self._offer('~/lift', self._lift, group)
        if self._explorer.arm.base_frame_id:
            self._offer('~/touch_surface', self._touch_surface, group)
            self._offer('~/forget_touches', self._forget_touches, group)
        ActionServer(
            self,
            action.Explore,
            'explore',
            self._on_goal,
            callback_group=group,
            cancel_callback=lambda _goal: CancelResponse.ACCEPT,
            result_timeout=RESULT_KEPT_S,
        )
        self.create_timer(IDLE_PERIOD_S, self._publish_idle)
        Diagnostics(self, self._report)
        self._publish_idle()
        check_names(self)  # before the arm is taken
        if self._autostart:
            self.trigger_configure()
            self.trigger_activate()
            self._autostart = False  # later transitions are requested
        else:
            self._explorer.release()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Check whether the arm answers, without taking control."""
        # The activation, which follows at once, also checks it.
        if not self._autostart and not self._tried(self._explorer.arm.check):
            return TransitionCallbackReturn.FAILURE
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take control of the arm; at the start of the node an arm that is not there yet is waited for."""
        usable = (
            self._tried(self._explorer.connect)
            and self._tried(self._name_pressed)
            and self._tried(self._explorer.check_start)
        )
        if not usable and not self._autostart:
            self._explorer.release()
            return TransitionCallbackReturn.FAILURE
        self._active = True
        return super().on_activate(state)

    def _name_pressed(self) -> None:
        """Log that the finger may press, if the force sensor shows that."""
        force_n = self._explorer.arm.state().force_n
        if force_n > self._explorer.touch.contact_force_n:
            self.get_logger().warning(PRESSED.format(force_n))

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Lift the finger and release the arm; a cleanup finds it released."""
        self._let_go()
        return super().on_deactivate(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Lift the finger and release the arm, from any state."""
        self._let_go()
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Release the arm after an internal error in a transition."""
        self.get_logger().error('a transition was aborted by an internal error; the arm is released')
        self._let_go()
        return super().on_error(state)

    def _let_go(self) -> None:
        self._active = False
        self._explorer.release()

    def _tried(self, step: Callable[[], object]) -> bool:
        """Return whether the arm allowed it; if not, log why: a warning while both may start."""
        try:
            step()
        except TextureError as error:
            if self._autostart and not ENDING.is_set():  # a wait that Ctrl-C ended is no fault
                self.get_logger().warning(f'{error}; the next request tries again')
            elif not ENDING.is_set():
                self.get_logger().error(str(error))
            return False
        return True

    def shutdown(self) -> None:
        """Lift the finger, release the arm, end all waits of clients."""
        self._closing, current = True, self._explorer.current
        self._explorer.close()
        if current is not None:  # logged here, while this node still can
            outcome = current.outcome if current.ended.is_set() else STILL_MOVING
            self._log_end(current.exploration_id, outcome)

    @property
    def names_elsewhere(self) -> set[str]:
        """Parameters of all arms: one file may serve several, and some names of one are near to ours."""
        return {item.name for arm in ARMS.values() for item in parameters_of(arm.Params)}

    def _make_explorer(self, params: ExplorerParams) -> Explorer:
        arm_class = find(ARMS, params.arm, 'arm')
        arm = arm_class(declare(self, arm_class.Params))
        motions = MOTIONS | {name: find(MOTIONS, name, 'motion') for name in params.motions.split()}
        explorer = Explorer(
            arm, TouchParams(), SafetyLimits(), self._on_state, signal_fault=self._watch_signal(), motions=motions
        )
        # Changed parameters hold from the next exploration on; those of arm and sensor are fixed.
        for name, kind in (('touch', TouchParams), ('limits', SafetyLimits), ('patch', SurfacePatch)):
            setattr(explorer, name, declare(self, kind, changeable=True))
            on_change(self, kind, partial(setattr, explorer, name))
        return explorer

    def _watch_signal(self) -> Callable[[Listening], str]:
        params = declare(self, SignalWatchParams)
        if not params.watch_signal:
            return no_signal_watch
        # The full name identifies finger and arm; at the root the usual name is 'signal'.
        try:
            names = {topic: self.resolve_topic_name(topic).removeprefix('/') for topic in params.topics}
        except RCLError as error:
            raise InvalidParameter(
                f"parameter 'signal_topics' is {' '.join(params.topics)!r}, which names no topics; give names of "
                "letters, digits, '_' and '/', separated by spaces"
            ) from error
        watch = SignalWatch(params.signal_timeout_s, time.monotonic_ns, tuple(names.values()))
        for topic, name in names.items():
            # Raw bytes: only their arrival counts.
            self.create_subscription(
                msg.TactileSignal, topic, lambda _data, name=name: watch.on_samples(name), SENSOR_QOS, raw=True
            )
        return watch.signal_fault

    def _on_service(self, request: srv.Explore.Request, response: srv.Explore.Response) -> srv.Explore.Response:
        response.result = self._explore(request.request, lambda exploration: exploration.ended.wait(), lambda: False)
        return response

    def _on_goal(self, goal: Any) -> action.Explore.Result:
        result = self._explore(
            goal.request.request, partial(self._give_feedback, goal), lambda: bool(goal.is_cancel_requested)
        )
        if goal.is_cancel_requested:
            goal.canceled()
        elif result.error_code == msg.ExplorationResult.ERROR_NONE:
            goal.succeed()
        else:
            goal.abort()
        return action.Explore.Result(result=result)

    def _explore(
        self, request: msg.ExplorationRequest, wait: Callable[[Exploration], None], cancelled: Callable[[], bool]
    ) -> msg.ExplorationResult:
        """Begin, wait until the finger is lifted, and return the result for the service or the action."""
        result = msg.ExplorationResult()
        try:
            exploration_id = new_id(self.get_clock().now().nanoseconds, next(self._numbers), self._rng)
            self._check_alone()
            self._check_clock()
            exploration = self._explorer.begin(exploration_id, from_msg(request), cancelled)
        except TextureError as error:
            result.error_code, result.message = int(refusal(error)), str(error)
            result.field = 'motion' if isinstance(error, UnknownName) else error.field
            # Their numbers are NaN, not the zeros that a new message holds.
            result.texture, result.roughness = map(to_msg, no_estimates('').values())
            self.get_logger().warning(f'refused: {error}')
            return result
        estimates = self._open[exploration.exploration_id] = no_estimates(exploration.exploration_id)
        try:
            wait(exploration)
            if exploration.outcome.slid:
                kinds = [kind for kind in ('texture', 'roughness') if self.count_publishers(kind)]
                end_s = time.monotonic() + self._estimate_timeout_s
                while not (self._closing or time.monotonic() > end_s or all(estimates[kind].final for kind in kinds)):
                    time.sleep(ESTIMATE_PERIOD_S)
        finally:
            del self._open[exploration.exploration_id]
        outcome = exploration.outcome
        result.error_code, result.message, result.lifted = int(outcome.error), outcome.message, outcome.lifted
        result.exploration_id = exploration.exploration_id
        result.texture, result.roughness = to_msg(estimates['texture']), to_msg(estimates['roughness'])
        of_model = (result.texture.model, result.texture.revision) == (self._model.model, self._model.revision)
        result.labels = self._model.labels if of_model and result.texture.probabilities else []
        self._last_end = outcome.sentence(exploration.exploration_id)
        self._not_lifted = '' if outcome.lifted else self._last_end
        self._last_error = outcome.error
        if not self._closing:
            self._log_end(exploration.exploration_id, outcome)
        return result

    def _check_alone(self) -> None:
        """Refuse to move while another explorer has this name: it moves its arm at the same requests."""
        if several := self._several():
            raise MotionRefused(several, ExplorationError.NOT_ACTIVE)

    def _several(self) -> str:
        """Return in a sentence that another explorer has this name, '' if none has."""
        # Not by the names of nodes: ROS may list some that have ended.
        several = self.count_services('explore') > 1
        return SEVERAL.format(self.context.get_domain_id(), self.get_namespace()) if several else ''

    def _check_clock(self) -> None:
        """Refuse to move while the time of ROS does not advance: states would have no valid stamps."""
        if not self.get_clock().now().nanoseconds:
            raise MotionRefused(
                "'use_sim_time' is true, and no time has arrived on '/clock'; start its publisher, or set it to false",
                ExplorationError.NOT_ACTIVE,
            )

    def _log_end(self, exploration_id: str, outcome: ExplorationOutcome) -> None:
        """Log how it ended: an abort is a warning, a finger that was not lifted an error."""
        logger, sentence = self.get_logger(), outcome.sentence(exploration_id)
        if outcome.success:
            logger.info(sentence)
        elif outcome.lifted:
            logger.warning(sentence)
        else:
            logger.error(sentence)

    def _give_feedback(self, goal: Any, exploration: Exploration) -> None:
        """Publish feedback to the client; stop when it cancels."""
        while not exploration.ended.wait(FEEDBACK_PERIOD_S):
            if goal.is_cancel_requested:
                exploration.stop('cancelled by the client', ExplorationError.CANCELLED)
            estimates = self._open[exploration.exploration_id]
            state = self._stamped(exploration.state)
            goal.publish_feedback(action.Explore.Feedback(state=to_msg(state), texture=to_msg(estimates['texture'])))

    def _offer(self, name: str, work: Callable[[], str], group: ReentrantCallbackGroup) -> None:
        """Offer a service without arguments; `work` returns a message, or raises an error."""

        def answer(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            try:
                response.message, response.success = work(), True
            except TextureError as error:
                response.message = str(error)
            self.get_logger().info(f'{name[2:]}: {response.message}')
            return response

        self.create_service(Trigger, name, answer, callback_group=group)

    def _stop(self) -> str:
        message = self._explorer.stop('stopped on request', STOP_COVERS_S)
        self._last_error = ExplorationError.STOPPED  # also for those who are between two explorations
        self._publish_info()
        time.sleep(STOP_COVERS_S)  # what is requested after the answer is not covered
        return self._of_one_arm(message)

    def _recover(self) -> str:
        self._check_alone()
        self._explorer.recover()
        return 'the arm can move'

    def _lift(self) -> str:
        return self._of_one_arm(f'the finger rose by {1e3 * self._explorer.lift():.1f} mm, and nothing touches it')

    def _of_one_arm(self, message: str) -> str:
        """Return what this arm did; MotionRefused, with it, if another one may not have had the request."""
        if several := self._several():
            raise MotionRefused(f'{message}, of one arm; look at the others: {several}', ExplorationError.NOT_ACTIVE)
        return message

    def _touch_surface(self) -> str:
        self._check_alone()
        message = self._explorer.touch_surface()
        self._broadcast_surface()
        self.set_parameters([Parameter(name, value=value) for name, value in asdict(self._explorer.patch).items()])
        return message

    def _forget_touches(self) -> str:
        return f'forgotten touches of the surface: {self._explorer.forget_touches()}; the surface stays as it is'

    def _on_estimate(self, message: msg.TextureEstimate | msg.RoughnessEstimate) -> None:
        try:
            estimate: TextureEstimate | RoughnessEstimate = from_msg(message)
        except InvalidData as error:
            self.get_logger().warning(f'an estimate was left out: {error}', throttle_duration_sec=1.0)
            return
        estimates = self._open.get(estimate.exploration_id)
        if estimates is None:
            return
        estimates['texture' if isinstance(estimate, TextureEstimate) else 'roughness'] = estimate
        current = self._explorer.current
        early = current and current.exploration_id == estimate.exploration_id and current.request.early_stopping
        if early and isinstance(estimate, TextureEstimate) and may_stop(estimate):
            current.finish(
                f"ended early: '{estimate.label}' is decided with {estimate.confidence:.2f} "
                f'after {estimate.evidence_s:.1f} s of evidence'
            )

    def _on_state(self, state: ExplorationState) -> None:
        with self._publishing:
            self._publish(self._stamped(state))

    def _publish_idle(self) -> None:
        with self._publishing:
            if self._explorer.current is None:
                idle = ExplorationState(self._explorer.clock(), '', '', Phase.IDLE, lifted=self._explorer.lifted)
                self._publish(self._stamped(idle))
        self._publish_info()

    def _publish_info(self) -> None:
        """Publish what the explorer can do, if that has changed."""
        limits, why_not = self._explorer.limits, self._why_not_ready()
        info = msg.ExplorerInfo(ready=not why_not, message=why_not, last_error_code=int(self._last_error))
        info.motions = list(self._explorer.motions)
        for motion, defaults in DEFAULTS.items():
            for name, value in defaults.items():
                low, high, unit = limits.range(name)
                number = {'default_value': limits.default(name, value), 'low': float(low), 'high': float(high)}
                info.numbers.append(msg.MotionNumber(motion=motion, field=name, unit=unit, **number))
        if info != self._info:
            self._info = info
            published = copy.copy(info)
            published.header = Header(stamp=self.get_clock().now().to_msg())
            with contextlib.suppress(RCLError):  # after a shutdown of ROS there is no subscriber
                self._infos.publish(published)

    def _why_not_ready(self) -> str:
        if not self._active:
            return f"{CONNECTING} '{self.get_parameter('arm').value}'" if self._autostart else NO_CONTROL
        return 'an exploration is running' if self._explorer.current else self._explorer.fault() or self._several()

    def _broadcast_surface(self) -> None:
        """Broadcast the pose of the surface in the base frame of the arm, if it has one."""
        arm = self._explorer.arm
        if not arm.base_frame_id:
            return
        header = Header(stamp=self.get_clock().now().to_msg(), frame_id=arm.base_frame_id)
        transform = TransformStamped(header=header, child_frame_id=self._surface_frame_id)
        shift, turned = transform.transform.translation, transform.transform.rotation
        shift.x, shift.y, shift.z = map(float, arm.surface_pose[:3])
        turned.x, turned.y, turned.z, turned.w = quaternion(arm.surface_pose[3:])
        self._transforms.publish(TFMessage(transforms=[transform]))

    def _publish(self, state: ExplorationState) -> None:
        try:
            self._states.publish(to_msg(state))
        except RCLError:
            # After a shutdown of ROS there is no subscriber, but the finger still has to be lifted.
            if self.context.ok():
                raise

    def _stamped(self, state: ExplorationState) -> ExplorationState:
        """Return the state with its stamp on the clock of ROS instead of CLOCK_MONOTONIC."""
        age_ns = self._explorer.clock() - state.stamp_ns
        stamp_ns = self.get_clock().now().nanoseconds - age_ns
        return replace(state, stamp_ns=stamp_ns, frame_id=self._surface_frame_id)

    def _report(self) -> DiagnosticReport:
        current, arm_fault = self._explorer.current, self._explorer.fault()
        numbers = {
            'phase': current.state.phase.value if current else Phase.IDLE.value,
            'exploration': current.exploration_id if current else '',
            'last_end': self._last_end,
            'arm_fault': arm_fault or 'none',
            **self._explorer.counts,
        }
        if not self._active:
            return 'WARN', self._why_not_ready(), numbers
        if fault := arm_fault or self._several():
            return 'ERROR', fault, numbers
        warning = self._explorer.arm.warning() or ('' if current else self._not_lifted)
        return ('WARN', warning, numbers) if warning else ('OK', 'the arm answers', numbers)


def main() -> None:
    """Run the node."""
    run(ExplorerNode, make_executor=WaitingExecutor, on_stop=ENDING.set)
