"""One node as a process of its own group, which ends with the launcher."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import IO, Any

import yaml

from texture_core.errors import LaunchFailed
from texture_launch import packages
from texture_launch.description import NodeDescription

PR_SET_PDEATHSIG = 1  # linux/prctl.h
LIBC = ctypes.CDLL(None)


def command(node: NodeDescription, parameter_folder: Path) -> list[str]:
    """Return the command line of a node; parameters given in the launch file are written to `parameter_folder`."""
    names = [f'__node:={node.name}'] * bool(node.name) + [f'__ns:={node.namespace}'] * bool(node.namespace)
    options = [part for rule in names for part in ('-r', rule)]
    for index, parameters in enumerate(node.parameters):
        file = parameters if isinstance(parameters, Path) else parameter_folder / f'{index}.yaml'
        if not isinstance(parameters, Path):
            _write_parameters(file, node.parameter_key, parameters)
        options += ['--params-file', str(file)]
    for source, target in node.remappings:
        options += ['-r', f'{source}:={target}']
    return [str(packages.executable(node.package, node.executable)), *node.arguments, '--ros-args', *options]


def _write_parameters(file: Path, key: str, parameters: Mapping[str, Any]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(yaml.safe_dump({key: {'ros__parameters': dict(parameters)}}))


def start(command_line: Sequence[str], environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
    """Start a process in a session of its own; the kernel sends it SIGTERM if the calling thread dies, however it dies.

    Call it from the main thread of a program without other threads.

    Raises
    ------
    LaunchFailed
        If the system refuses to start it.
    """
    try:
        return _popen(command_line, environment)
    except OSError as error:
        raise LaunchFailed(f"'{command_line[0]}' cannot be started: {error.strerror}") from error


def _popen(command_line: Sequence[str], environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        command_line,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        # A pipe would hold the output of Python programs back until 8 KiB have come together.
        env={**environment, 'PYTHONUNBUFFERED': '1'},
        preexec_fn=partial(end_with, os.getpid(), signal.SIGTERM),  # noqa: PLW1509 - the launcher is a program without threads
        start_new_session=True,
    )


def end_with(parent: int, number: signal.Signals) -> None:
    """Let the kernel send this process a signal when its parent dies, however it dies."""
    if hasattr(LIBC, 'prctl'):
        LIBC.prctl(PR_SET_PDEATHSIG, number)
    if os.getppid() != parent:  # it died before the wish was made
        os._exit(1)


def send(process: subprocess.Popen[bytes], number: signal.Signals) -> None:
    """Send a signal to the whole group of a process; one that is gone is left alone."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, number)


def interrupt(process: subprocess.Popen[bytes]) -> None:
    """Ask a process and its group to end: by SIGINT, or by SIGTERM while it cannot answer to a signal yet.

    A Python program that is still importing would only print a traceback on SIGINT. It has its own handlers for SIGINT
    and SIGTERM once it runs, and none for SIGTERM before.
    """
    send(process, signal.SIGINT if _catches(process.pid, signal.SIGTERM) else signal.SIGTERM)


def _catches(pid: int, number: signal.Signals) -> bool:
    """Return whether a process has a handler for a signal; True where that cannot be found out."""
    try:
        status = Path(f'/proc/{pid}/status').read_text(encoding='ascii', errors='replace')
    except OSError:
        return True
    caught = next((line.split()[1] for line in status.splitlines() if line.startswith('SigCgt:')), 'f' * 16)
    return bool(int(caught, 16) >> (number - 1) & 1)


def pipe(stream: IO[bytes] | None) -> IO[bytes]:
    """Return a stream of a process that `start` has given a pipe."""
    assert stream is not None
    return stream


def ending(returncode: int) -> str:
    """Return how a process ended, in words."""
    if returncode >= 0:
        return f'died with exit code {returncode}' if returncode else 'has finished'
    try:
        return f'was killed by {signal.Signals(-returncode).name}'
    except ValueError:
        return f'was killed by signal {-returncode}'
