"""The dashboard server: one line asks, one line answers.

Beside the real commands it obeys the fault switches of the emulator: `emulate protective stop`,
`emulate offline SECONDS`, `emulate slow SECONDS`, which lets stops, the end of force control and zeroing be
acknowledged so much later, `emulate drop METRES`, which lowers the surface under the finger by so much, and
`emulate friction COEFFICIENT`, as of another sample under the finger.
`load NAME` and `play` start a program of somebody else, which takes no commands.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial

from texture_simulation.devices.ur.controller import EmulatedController
from texture_simulation.devices.ur.tables import SAFETY_NAMES

BANNER = b'Connected: Universal Robots Dashboard Server\n'
SERIAL_NUMBER = '20205500001'
TOO_EARLY = (
    'Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective stop before unlocking'
)


class DashboardSession:
    """The conversation with one client."""

    def __init__(
        self,
        controller: EmulatedController,
        go_offline: Callable[[float], None],
        go_silent: Callable[[float], None],
    ) -> None:
        self._controller = controller
        self._go_offline = go_offline
        self._go_silent = go_silent
        self._received = b''

    def greeting(self) -> bytes:
        """Return the line with which the server begins."""
        return BANNER

    def receive(self, data: bytes) -> bytes:
        """Take over what came; return the answers."""
        *lines, self._received = (self._received + data).split(b'\n')
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

    def _version(self, _argument: str) -> str:
        numbers = '.'.join(str(number) for number in self._controller.version.numbers)
        return f'URSoftware {numbers} (emulated)'

    def _load(self, argument: str) -> str:
        self._controller.loaded = argument
        return f'Loading program: {argument}'

    def _loaded(self, _argument: str) -> str:
        loaded = self._controller.loaded
        return f'Loaded program: {loaded}' if loaded else 'No program loaded'

    def _play(self, _argument: str) -> str:
        if not self._controller.loaded:
            return 'Failed to execute: play'
        self._controller.play(self._controller.loaded)
        return 'Starting program'

    def _pause(self, _argument: str) -> str:
        self._controller.pause()
        return 'Pausing program'

    def _state(self, _argument: str) -> str:
        controller = self._controller
        state = 'PAUSED' if controller.paused else 'PLAYING' if controller.playing else 'STOPPED'
        return f'{state} {controller.program_name}'

    def _stop(self, _argument: str) -> str:
        self._controller.stop_program()
        return 'Stopped'

    def _unlock(self, _argument: str) -> str:
        return 'Protective stop releasing' if self._controller.unlock() else TOO_EARLY

    def _emulate_stop(self, _argument: str) -> str:
        self._controller.protective_stop()
        return f'Safetystatus: {self._safety()}'

    def _emulate_offline(self, argument: str) -> str:
        return self._with_seconds(argument, self._go_offline, 'Going offline')

    def _emulate_silence(self, argument: str) -> str:
        return self._with_seconds(argument, self._go_silent, 'Falling silent')

    def _emulate_slow(self, argument: str) -> str:
        return self._with_seconds(argument, partial(setattr, self._controller, 'acknowledge_s'), 'Acknowledging late')

    def _emulate_speed(self, argument: str) -> str:
        robot = self._controller.robot
        return self._with_number(argument, partial(setattr, robot, 'speed_share'), 'The speed was set', 'shares')

    def _emulate_drop(self, argument: str) -> str:
        plane = self._controller.robot.surface
        return self._with_number(argument, partial(setattr, plane, 'drop_m'), 'The surface was moved', 'metres')

    def _emulate_friction(self, argument: str) -> str:
        plane = self._controller.robot.surface
        return self._with_number(argument, partial(setattr, plane, 'friction'), 'The friction was set', 'newtons per N')

    def _with_seconds(self, argument: str, use: Callable[[float], None], done: str) -> str:
        return self._with_number(argument, use, done, 'seconds')

    @staticmethod
    def _with_number(argument: str, use: Callable[[float], None], done: str, unit: str) -> str:
        try:
            number = float(argument)
        except ValueError:
            number = math.nan
        if not 0 <= number < math.inf:
            return f"came '{argument}'; a number of {unit} is needed"
        use(number)
        return done


Answer = Callable[[DashboardSession, str], str]


def _fixed(text: str) -> Answer:
    return lambda _session, _argument: text


ANSWERS: Mapping[str, Answer] = {
    'polyscopeversion': DashboardSession._version,
    'get serial number': _fixed(SERIAL_NUMBER),
    'get robot model': _fixed('UR5'),
    'is in remote control': _fixed('true'),
    'robotmode': _fixed('Robotmode: RUNNING'),
    'safetystatus': lambda session, _argument: f'Safetystatus: {session._safety()}',
    'safetymode': lambda session, _argument: f'Safetymode: {session._safety()}',
    'running': lambda session, _argument: f'Program running: {str(session._controller.playing).lower()}',
    'programstate': DashboardSession._state,
    'get loaded program': DashboardSession._loaded,
    'isprogramsaved': _fixed('true rtde_control'),
    'load': DashboardSession._load,
    'play': DashboardSession._play,
    'stop': DashboardSession._stop,
    'pause': DashboardSession._pause,
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
    'emulate silence': DashboardSession._emulate_silence,
    'emulate slow': DashboardSession._emulate_slow,
    'emulate speed': DashboardSession._emulate_speed,
    'emulate drop': DashboardSession._emulate_drop,
    'emulate friction': DashboardSession._emulate_friction,
}
