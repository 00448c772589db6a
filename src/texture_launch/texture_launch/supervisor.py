"""Run the nodes of a launch file together: show what they say, restart what may be restarted, leave nothing behind."""

from __future__ import annotations

import selectors
import signal
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from subprocess import Popen

from texture_core import resources
from texture_launch import process
from texture_launch.description import NodeDescription
from texture_launch.output import Output

# How nodes are asked to end: so many seconds after the wish, this signal.
STOP = ((0.0, signal.SIGINT), (5.0, signal.SIGTERM), (8.0, signal.SIGKILL))
STOPPING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
POLL_S = 0.1
PROFILES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')  # where Fast DDS looks for settings
MISTAKE = 2  # exit code of a node that was given something it cannot use, and said so


@dataclass(frozen=True, eq=False)
class Job:
    """A node with its command line."""

    node: NodeDescription
    command: Sequence[str]
    again: bool = False  # it has died before

    @property
    def environment(self) -> Mapping[str, str]:
        """The environment of its process; in the place of a dead one, Fast DDS has settings to be discovered soon."""
        given = self.node.environment
        if not self.again or any(given.get(name) for name in PROFILES):
            return given
        return {**given, PROFILES[0]: str(resources.folder('texture_bringup', 'config/fastdds') / 'restart.xml')}


@dataclass(frozen=True, eq=False)
class Running:
    """A job that has been started."""

    job: Job
    process: Popen[bytes]
    outputs: tuple[Output, ...]

    @property
    def label(self) -> str:
        """How the node is called in the output."""
        return self.job.node.label


class Supervisor:
    """Run nodes until all have ended or a stop is asked for.

    Parameters
    ----------
    nodes
        What to run.
    say
        Receives each line to show, without its line end.
    together
        Whether all are stopped when one dies, whatever the launch file says about it, and none is started again.
    """

    def __init__(self, nodes: Sequence[NodeDescription], say: Callable[[str], None], *, together: bool = False) -> None:
        self._nodes = nodes
        self._say = say
        self._together = together
        self._due: list[tuple[float, Job]] = []  # when to start it
        self._running: list[Running] = []
        self._selector = selectors.DefaultSelector()
        self._stopping_since_s: float | None = None
        self._signals_sent = 0
        self._failed = False

    def run(self) -> int:
        """Run the nodes to their end; return 0 if none died by itself, else 1.

        SIGINT, SIGTERM and SIGHUP stop them; a second one goes on to the next stronger signal at once.
        """
        handlers = {number: signal.signal(number, self._on_signal) for number in STOPPING_SIGNALS}
        with tempfile.TemporaryDirectory(prefix='texture_launch_') as folder:
            try:
                jobs = [Job(node, process.command(node, Path(folder) / str(i))) for i, node in enumerate(self._nodes)]
                self._due = [(0.0, job) for job in jobs]
                while self._running or self._due:
                    self._step(time.monotonic())
            finally:
                self._kill_all()
                for number, handler in handlers.items():
                    signal.signal(number, handler)
        return int(self._failed)

    def stop(self) -> None:
        """Begin to stop all nodes, or, if that has begun, go on to the next stronger signal."""
        now = time.monotonic()
        if self._stopping_since_s is None:
            self._stopping_since_s = now
        elif self._signals_sent < len(STOP):
            self._stopping_since_s = now - STOP[self._signals_sent][0]

    def _on_signal(self, _number: int, _frame: object) -> None:
        self.stop()

    def _step(self, now: float) -> None:
        if self._stopping_since_s is not None:
            self._due.clear()
            self._send_signals(now - self._stopping_since_s)
        for when, job in list(self._due):
            if when <= now:
                self._due.remove((when, job))
                self._start(job)
        for key, _ in self._selector.select(POLL_S):
            if not key.data.read():  # the end of the stream: it would stay readable for ever
                self._selector.unregister(key.fileobj)
        for running in list(self._running):
            if running.process.poll() is not None:
                self._end(running)

    def _start(self, job: Job) -> None:
        started = process.start(job.command, job.environment)
        # As upstream: without output="screen", what a node prints is not shown, only its log and error messages.
        printed = self._say if job.node.screen else _nowhere
        label = job.node.label
        outputs = (
            Output(process.pipe(started.stdout), label, printed),
            Output(process.pipe(started.stderr), label, self._say),
        )
        for output in outputs:
            self._selector.register(output.stream, selectors.EVENT_READ, output)
        self._running.append(Running(job, started, outputs))
        self._say(f'[launch] {label} started (process {started.pid})')

    def _send_signals(self, since_s: float) -> None:
        while self._signals_sent < len(STOP) and STOP[self._signals_sent][0] <= since_s:
            number = STOP[self._signals_sent][1]
            self._signals_sent += 1
            if self._running:
                self._say(f'[launch] {number.name} to {", ".join(running.label for running in self._running)}')
            for running in self._running:
                if number == signal.SIGINT:
                    process.interrupt(running.process)
                else:
                    process.send(running.process, number)

    def _end(self, running: Running) -> None:
        self._forget(running)
        node, returncode = running.job.node, running.process.returncode
        requested_for = self._stopping_since_s is not None
        # What was started wrongly would only end again.
        restart = node.respawn and returncode != MISTAKE and not (requested_for or self._together)
        needed = node.needed or node.respawn or (self._together and returncode != 0)
        self._failed |= returncode != 0 and not (requested_for or restart)
        self._say(f'[launch] {running.label} {process.ending(returncode)}')
        if restart:
            self._due.append((time.monotonic() + node.respawn_delay_s, replace(running.job, again=True)))
        elif needed and not requested_for:
            self._say(f'[launch] {running.label} is needed by the others, which are stopped now')
            self.stop()

    def _forget(self, running: Running) -> None:
        self._running.remove(running)
        process.send(running.process, signal.SIGKILL)  # what it had started itself
        for output in running.outputs:
            if output.stream.fileno() in self._selector.get_map():
                self._selector.unregister(output.stream)
            output.close()

    def _kill_all(self) -> None:
        """End what an error of the launcher itself has left."""
        for running in list(self._running):
            process.send(running.process, signal.SIGKILL)
            running.process.wait()
            self._forget(running)
        self._selector.close()


def _nowhere(_line: str) -> None:
    pass
