# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""`texture watch`: show signal, finger and estimates on the terminal, live or from a bag."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from typing import Any

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from texture_bringup.feed import FRAME_PERIOD_S, UNKNOWN, Feed, in_words
from texture_core.cli import add_namespace
from texture_core.errors import ExplorationError
from texture_core.types import NANOSECONDS

BAR, LABELS = 30, 5
LONGEST_PAUSE_S = 1.0  # between two messages of a bag
NO_SAMPLES = 'no samples yet (live: start the nodes, or give their --namespace)'
Frame = Mapping[str, Any]


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('bag', nargs='?', help='bag to show instead of the running nodes')
    add_namespace(parser)


def run(options: argparse.Namespace) -> int:
    """Show what happens until Ctrl-C or the end of the bag: a picture on a terminal, else a line for each change."""
    feed, console = Feed(), Console()
    live = Live(console=console, auto_refresh=False) if console.is_terminal else nullcontext()
    with live:
        show = _picture(feed, live) if isinstance(live, Live) else _lines(feed)
        if options.bag:
            _play(options.bag, options.namespace, feed, show)
        else:
            from texture_bringup.operator import Operator  # noqa: PLC0415 - a bag is shown without ROS

            with Operator(options.namespace) as operator:
                operator.watch(feed, show)
    return 0


def _play(bag: str, namespace: str, feed: Feed, show: Callable[[], None]) -> None:
    """Give the messages of a bag to the feed at their pace."""
    from texture_recordings.bags import read_bag  # noqa: PLC0415 - nothing else needs it

    last_ns, feed.recorded = None, True
    for topic, log_ns, value in read_bag(bag, feed.topics, namespace or None):
        pause_s = 0.0 if last_ns is None else (log_ns - last_ns) / NANOSECONDS
        time.sleep(min(max(0.0, pause_s), LONGEST_PAUSE_S))
        last_ns = log_ns
        feed.topics[topic][1](value)
        show()
    time.sleep(FRAME_PERIOD_S)
    show()  # the end, which came too soon after the frame before


# --------------------
# On a terminal: one picture, drawn anew.


def _picture(feed: Feed, live: Live) -> Callable[[], None]:
    """Return a function that draws the newest frame, at most ten times a second."""
    drawn_s, peak = 0.0, 0.0

    def show() -> None:
        nonlocal drawn_s, peak
        now_s = time.monotonic()
        if now_s - drawn_s >= FRAME_PERIOD_S:
            frame = feed.frame(now_s)
            peak = max(peak, frame['signal']['level'] or 0.0)
            live.update(picture(frame, peak), refresh=True)
            drawn_s = now_s

    return show


def picture(frame: Frame, peak: float) -> Group:
    """Return a frame as rows of a name, a bar and numbers; `peak` is the level that fills its bar."""
    signal, state, texture, roughness = (frame[name] for name in ('signal', 'state', 'texture', 'roughness'))
    rows = Table.grid(padding=(0, 2))
    rows.add_column(min_width=12)
    level = signal['level'] or 0.0
    named = f'{level:.3g} {signal["unit"]}  {signal["sensor"]} {signal["channel"]}'
    rows.add_row('signal', bar(level / peak if peak else 0.0, 'cyan'), named if signal['sensor'] else NO_SAMPLES)
    rows.add_row(Text(state['phase'], style='bold'), bar(state['progress'] or 0.0, 'white'), finger_text(state))
    rows.add_row()
    style = 'green' if texture['accepted'] else 'yellow'
    for label, probability in list(zip(texture['labels'], texture['probabilities'], strict=True))[:LABELS]:
        rows.add_row(label, bar(probability, style), f'{probability:.2f}')
    lights = (light for light in frame['lights'] if light['colour'] not in ('green', 'grey'))
    faults = [light for light in lights if light['message'] not in texture['text']]
    return Group(
        rows,
        Text(f'texture    {texture["text"]}', style=f'bold {style}'),
        *([Text(f'roughness  {roughness["text"]}')] if roughness['text'] else []),
        *(Text(f'{light["name"]}: {light["message"]}', style=light['colour']) for light in faults),
    )


def bar(fraction: float, style: str) -> Text:
    """Return a bar that is filled to a fraction."""
    full = round(BAR * min(max(fraction, 0.0), 1.0))
    return Text.assemble(('█' * full, style), ('─' * (BAR - full), 'dim'))


# --------------------
# Elsewhere: a line for each change.


def _lines(feed: Feed) -> Callable[[], None]:
    """Return a function that prints the newest frame if its phase or its estimate has changed, or samples have come."""
    last: tuple[Any, ...] = ()

    def show() -> None:
        nonlocal last
        state, texture, grade = feed.newest()
        key = state.exploration_id, state.phase, texture.label, texture.rejection, grade.valid, feed.senses
        if key != last:
            last = key
            print(line(feed.frame(time.monotonic())), flush=True)

    return show


def line(frame: Frame) -> str:
    """Return a frame as one line."""
    signal, state, texture = frame['signal'], frame['state'], frame['texture']
    level = f'level {signal["level"]:.3g} {signal["unit"]}' if signal['level'] is not None else NO_SAMPLES
    roughness = f'roughness {frame["roughness"]["text"]}' if frame['roughness']['valid'] else ''
    return ' | '.join(filter(None, [f'{state["phase"]:<9}', finger_text(state), level, texture['text'], roughness]))


def finger_text(state: Mapping[str, Any]) -> str:
    """Return speed, force, motion and error of a frame as text."""
    numbers = [text for text in (state['speed'], state['force']) if text != UNKNOWN]
    error = in_words(ExplorationError(state['error_code'])) if state['error_code'] else ''
    return '  '.join([*numbers, *filter(None, [state['motion'], error])]) or 'no exploration'
