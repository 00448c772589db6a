# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Show the finger in types that standard tools draw: samples as curves, taxels, the path of the slide, its wrench."""

from __future__ import annotations

import array
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, WrenchStamped
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Image
from std_msgs.msg import ColorRGBA, Header
from texture_msgs import msg
from visualization_msgs.msg import Marker

from texture_bringup.feed import places_of
from texture_core.errors import TextureError
from texture_core.ros import SENSOR_QOS, STATE_QOS, DiagnosticReport, Diagnostics, from_msg, run, to_stamp
from texture_core.types import NANOSECONDS, ExplorationState, Phase, TactileSignal

MAX_RATE_HZ = 2500.0  # messages a second of the curve, which plots of other programs keep up with
PATH_S = 0.2  # how often the path is drawn anew
PATH_POINTS = 5000
PATH_WIDTH_M = 0.001
PATH_COLOUR = ColorRGBA(r=1.0, g=0.85, b=0.1, a=1.0)
NEWTON_MILLIMETRES = 1e-3
# rqt_plot and RViz ask for reliable delivery, which a best-effort publisher does not offer.
VIEW_QOS = QoSProfile(depth=1000)


VIEW_TYPES: Mapping[str, type] = {'signal': msg.SignalSample, 'taxels': Image, 'wrench': WrenchStamped, 'path': Marker}


def curve(batch: TactileSignal) -> Iterator[tuple[int, NDArray[np.float32]]]:
    """Yield time, ns, and value of each channel, (n_channels,), of the points by which a batch is drawn.

    They are its samples or, where these are more than MAX_RATE_HZ, the lowest and the highest of as many samples as
    needed, at a spacing of half of these samples.
    """
    step = 2 * math.ceil(batch.sampling_rate_hz / MAX_RATE_HZ) if batch.sampling_rate_hz > MAX_RATE_HZ else 1
    starts = np.arange(0, len(batch.samples), step)
    rows = batch.samples
    if step > 1:
        extremes = [ufunc.reduceat(rows, starts, axis=0) for ufunc in (np.fmin, np.fmax)]
        rows = np.stack(extremes, axis=1).reshape(-1, rows.shape[1])
        starts = np.stack([starts, starts + step // 2], axis=1).ravel()
    times_ns = batch.stamp_ns + np.round(starts * (NANOSECONDS / batch.sampling_rate_hz)).astype(np.int64)
    return zip(times_ns.tolist(), rows, strict=True)


def taxel_image(batch: TactileSignal) -> NDArray[np.float32]:
    """Return the newest sample as an image, (n_rows, n_columns), by row and column in the names of the channels.

    NaN where there is no channel.
    """
    places = np.array(places_of(batch.channels))
    image = np.full(places.max(axis=0) + 1, np.nan, np.float32)
    image[places[:, 0], places[:, 1]] = batch.samples[-1]
    return image


class Views(Node):
    """Publish views of the topics in its namespace; each is computed only while it has a subscriber."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('views', **kwargs)
        self._points: list[Point] = []
        self._state: ExplorationState | None = None
        self._bad = 0
        self._curve, self._image, self._wrench, self._path = (
            self.create_publisher(kind, f'~/{name}', VIEW_QOS) for name, kind in VIEW_TYPES.items()
        )
        # By topic: the view that is made of it, and what takes its messages.
        for topic, view, take in (
            ('signal', self._curve, self._draw),
            ('signal_static', self._image, self._show_taxels),
            ('signal_wrench', self._wrench, self._show_wrench),
        ):
            self.create_subscription(msg.TactileSignal, topic, self._taking(view, take), SENSOR_QOS)
        self.create_subscription(msg.ExplorationState, 'exploration', self._taking(self._path, self._follow), STATE_QOS)
        self.create_timer(PATH_S, self._draw_path)
        Diagnostics(self, self._report)

    def _taking(self, view: Any, take: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return what takes a message while a view has a subscriber."""

        def on_message(message: Any) -> None:
            if not view.get_subscription_count():
                return
            try:
                value = from_msg(message)
            except TextureError as error:
                self._bad += 1
                self.get_logger().warning(f'left out: {error}', throttle_duration_sec=10.0)
                return
            if not isinstance(value, TactileSignal) or len(value.samples):
                take(value)

        return on_message

    def _draw(self, batch: TactileSignal) -> None:
        for time_ns, row in curve(batch):
            header = Header(stamp=to_stamp(time_ns), frame_id=batch.frame_id)
            self._curve.publish(msg.SignalSample(header=header, values=array.array('f', row.tobytes())))

    def _show_taxels(self, batch: TactileSignal) -> None:
        image = taxel_image(batch)
        height, width = image.shape
        shown = Image(header=_newest(batch), height=height, width=width, encoding='32FC1', step=4 * width)
        shown.data = array.array('B', image.tobytes())
        self._image.publish(shown)

    def _show_wrench(self, batch: TactileSignal) -> None:
        values = dict(zip(batch.channels, batch.samples[-1].tolist(), strict=True))
        shown = WrenchStamped(header=_newest(batch))
        for axis in 'xyz':
            setattr(shown.wrench.force, axis, values.get(f'f{axis}', math.nan))
            setattr(shown.wrench.torque, axis, NEWTON_MILLIMETRES * values.get(f't{axis}', math.nan))
        self._wrench.publish(shown)

    def _follow(self, state: ExplorationState) -> None:
        if state.phase is not Phase.SLIDE or math.isnan(state.x_m):
            return
        if self._state is None or state.exploration_id != self._state.exploration_id:
            self._points = []
        self._state = state
        if len(self._points) < PATH_POINTS:
            self._points.append(Point(x=state.x_m, y=state.y_m, z=state.z_m))

    def _draw_path(self) -> None:
        """Publish the path of the slide; each exploration replaces the one before."""
        if self._state is None or not self._path.get_subscription_count():
            return
        path = Marker(type=Marker.LINE_STRIP, action=Marker.ADD, ns='path', frame_locked=True, points=self._points)
        path.header = Header(stamp=to_stamp(self._state.stamp_ns), frame_id=self._state.frame_id)
        path.pose.orientation.w, path.scale.x, path.color = 1.0, PATH_WIDTH_M, PATH_COLOUR
        self._path.publish(path)

    def _report(self) -> DiagnosticReport:
        views = (self._curve, self._image, self._wrench, self._path)
        watched = [view.topic_name for view in views if view.get_subscription_count()]
        message = f'shows {", ".join(watched)}' if watched else 'no subscriber, so nothing is computed'
        return 'WARN' if self._bad else 'OK', message, {'bad_messages': self._bad}


def _newest(batch: TactileSignal) -> Header:
    """Return the header of the newest sample of a batch."""
    age_ns = round((len(batch.samples) - 1) / batch.sampling_rate_hz * NANOSECONDS)
    return Header(stamp=to_stamp(batch.stamp_ns + age_ns), frame_id=batch.frame_id)


def main() -> None:
    """Run the node."""
    run(Views)
