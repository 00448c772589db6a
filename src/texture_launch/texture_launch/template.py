"""Texts with substitutions such as `$(var speed)`, as ROS 2 launch files write them."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from texture_core.errors import InvalidLaunch

# A text in a launch file is a path, a number or a short list. Twenty that double each other would fill the memory.
MAX_CHARACTERS = 10_000
MAX_DEPTH = 30  # of calls within each other
NAME = re.compile(r'[A-Za-z][\w-]*')


@dataclass(frozen=True)
class Call:
    """One substitution: `$(name argument …)`; each argument is a template of its own."""

    name: str
    arguments: tuple[Template, ...]


Part = str | Call
Template = tuple[Part, ...]
Perform = Callable[[str, Sequence[str]], str]


def parse(text: str) -> Template:
    """Return the parts of a text in order: literal strings and calls.

    A backslash takes the next character literally. Inside a call, arguments stand one space apart; an argument with
    spaces is quoted.

    Raises
    ------
    InvalidLaunch
        If a call is not closed or not well formed.
    """
    return _Reader(_bounded(text)).template(stop='')


def expand(template: Template, perform: Perform) -> str:
    """Return the text of a template; `perform(name, arguments)` gives the text of a call, innermost first."""
    expanded = ''
    for part in template:
        expanded = _bounded(expanded + (part if isinstance(part, str) else _expand_call(part, perform)))
    return expanded


def _bounded(text: str) -> str:
    if len(text) > MAX_CHARACTERS:
        raise InvalidLaunch(
            f'a text has {len(text)} characters, with what stands for its calls; {MAX_CHARACTERS} are allowed'
        )
    return text


def _expand_call(call: Call, perform: Perform) -> str:
    return perform(call.name, [expand(argument, perform) for argument in call.arguments])


class _Reader:
    """Read a text from left to right."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0
        self._depth = 0

    def template(self, stop: str) -> Template:
        """Return the parts up to the end or the first plain character of `stop`."""
        parts: list[Part] = []
        while self._at < len(self._text) and self._text[self._at] not in (*stop,):
            if self._text.startswith('$(', self._at):
                parts.append(self._call())
            elif parts and isinstance(parts[-1], str):
                parts[-1] += self._character()
            else:
                parts.append(self._character())
        return tuple(parts)

    def _character(self) -> str:
        if self._text[self._at] == '\\' and self._at + 1 < len(self._text):
            self._at += 1
        self._at += 1
        return self._text[self._at - 1]

    def _call(self) -> Call:
        start = self._at
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise InvalidLaunch(f'a text has substitutions more than {MAX_DEPTH} deep within each other')
        self._at += len('$(')
        name = NAME.match(self._text, self._at)
        if not name:
            raise self._malformed(start)
        self._at = name.end()
        arguments = []
        while self._text.startswith(' ', self._at):
            self._at += 1
            arguments.append(self._argument(start))
        if not self._text.startswith(')', self._at):
            raise self._malformed(start)
        self._at += 1
        self._depth -= 1
        return Call(name.group(), tuple(arguments))

    def _argument(self, start: int) -> Template:
        quote = self._text[self._at : self._at + 1]
        if quote in ("'", '"') and quote:
            self._at += 1
            argument = self.template(stop=quote)
            if not self._text.startswith(quote, self._at):
                raise self._malformed(start)
            self._at += 1
            return argument
        argument = self.template(stop=' )')
        if not argument:
            raise self._malformed(start)
        return argument

    def _malformed(self, start: int) -> InvalidLaunch:
        return InvalidLaunch(
            f"'{self._text[start:]}' is no substitution; write $(name argument …), closed and with single spaces"
        )
