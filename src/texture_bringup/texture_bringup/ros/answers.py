"""Wait in a coroutine for what ROS answers in its own thread."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

from rclpy.task import Future

from texture_core.errors import LaunchFailed

FOUND_DEADLINE_S, FOUND_STEP_S = 5.0, 0.05


async def ready(is_ready: Callable[[], bool], node: str) -> None:
    """Wait until a node can be asked: one that has just started is found a moment later.

    Raises
    ------
    LaunchFailed
        If it is not there in time.
    """
    deadline_s = time.monotonic() + FOUND_DEADLINE_S
    while not is_ready():
        if time.monotonic() > deadline_s:
            raise LaunchFailed(f'no {node} answers; is it running?')
        await asyncio.sleep(FOUND_STEP_S)


async def answer_of(future: Future, deadline_s: float) -> Any:
    """Return the result of a future of ROS, which the executor's thread completes.

    Raises
    ------
    LaunchFailed
        If it does not come in time.
    """
    loop = asyncio.get_running_loop()
    answered: asyncio.Event = asyncio.Event()
    future.add_done_callback(lambda _future: loop.call_soon_threadsafe(answered.set))
    try:
        await asyncio.wait_for(answered.wait(), deadline_s)
    except asyncio.TimeoutError as error:
        raise LaunchFailed(f'no answer within {deadline_s:.0f} s') from error
    return future.result()
