"""The dashboard server: one line asks, one line answers.

Beside the real commands it obeys the fault switches of the emulator: `emulate protective stop` and
`emulate offline SECONDS`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from texture_simulation.devices.ur.controller import Controller
from texture_simulation.devices.ur.tables import SAFETY_NAMES

BANNER = b'Connected: Universal Robots Dashboard Server\n'
SERIAL_NUMBER = '20205500001'
TOO_EARLY = (
    'Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective stop before unlocking'
)


class DashboardSession:
    """The conversation with one client."""

    def __init__(self, controller: Controller, go_offline: Callable[[float], None]) -> None:
        self._controller = controller
        self._go_offline = go_offline
        self._heard = b''

    def greeting(self) -> bytes:
        """Return the line with which the server begins."""
        return BANNER

    def receive(self, data: bytes) -> bytes:
        """Take over what came; return the answers."""
        *lines, self._heard = (self._heard + data).split(b'\n')
        return b''.join(self._answer(line.decode('utf-8', 'replace').strip()).encode() + b'\n' for line in lines)

    def close(self) -> None:
        """Leave nothing behind."""

    def package(self) -> bytes:
        """Say nothing unasked."""
        return b''

    def _answer(self, line: str) -> str:
        for command, answer in ANSWERS.items():
            if line.lower() == command or line.lower().startswith(command + ' '):
                return answer(self, line[len(command) :].strip())
        return f'could not understand: {line}'

    def _safety(self) -> str:
        return SAFETY_NAMES[self._controller.safety]

    def _version(self, _rest: str) -> str:
        numbers = '.'.join(str(number) for number in self._controller.version.numbers)
        return f'URSoftware {numbers} (emulated)'

    def _play(self, _rest: str) -> str:
        return 'Failed to execute: play'  # there is no program from which it could

    def _stop(self, _rest: str) -> str:
        self._controller.stop_program()
        return 'Stopped'

    def _unlock(self, _rest: str) -> str:
        return 'Protective stop releasing' if self._controller.unlock() else TOO_EARLY

    def _emulate_stop(self, _rest: str) -> str:
        self._controller.protective_stop()
        return f'Safetystatus: {self._safety()}'

    def _emulate_offline(self, rest: str) -> str:
        try:
            seconds = float(rest)
        except ValueError:
            seconds = math.nan
        if not 0 <= seconds < math.inf:
            return f"came '{rest}'; a number of seconds is needed"
        self._go_offline(seconds)
        return 'Going offline'


Answer = Callable[[DashboardSession, str], str]


def _fixed(text: str) -> Answer:
    return lambda _session, _rest: text


ANSWERS: Mapping[str, Answer] = {
    'polyscopeversion': DashboardSession._version,
    'get serial number': _fixed(SERIAL_NUMBER),
    'get robot model': _fixed('UR5'),
    'is in remote control': _fixed('true'),
    'robotmode': _fixed('Robotmode: RUNNING'),
    'safetystatus': lambda session, _rest: f'Safetystatus: {session._safety()}',
    'safetymode': lambda session, _rest: f'Safetymode: {session._safety()}',
    'running': lambda session, _rest: f'Program running: {str(session._controller.playing).lower()}',
    'programstate': lambda session, _rest: f'{"PLAYING" if session._controller.playing else "STOPPED"} rtde_control',
    'get loaded program': _fixed('No program loaded'),
    'isprogramsaved': _fixed('true rtde_control'),
    'play': DashboardSession._play,
    'stop': DashboardSession._stop,
    'pause': DashboardSession._stop,
    'unlock protective stop': DashboardSession._unlock,
    'close safety popup': _fixed('closing safety popup'),
    'close popup': _fixed('closing popup'),
    'popup': _fixed('showing popup'),
    'addtolog': _fixed('Added log message'),
    'power on': _fixed('Powering on'),
    'brake release': _fixed('Brake releasing'),
    'quit': _fixed('Disconnected'),
    'emulate protective stop': DashboardSession._emulate_stop,
    'emulate offline': DashboardSession._emulate_offline,
}
