"""Names of files and arrays that hold values, such as '{material}_run{run}.csv'."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from texture_core.errors import InvalidParameter

FIELD = re.compile(r'\{(\w*)\}|\*')
ANYTHING = ''


@dataclass(frozen=True)
class NameTemplate:
    """A name with fields in braces; '*' and '{}' stand for any text that is not kept.

    A field is one character or more, holds no '/', and ends where the text behind it in the template comes first. So
    no name takes long to compare.

    Parameters
    ----------
    text
        The template; its parts between slashes are compared one by one.

    Raises
    ------
    InvalidParameter
        If two fields follow each other without text between them, or a name occurs twice.

    Examples
    --------
    >>> NameTemplate('{material}/{speed}mms_*.csv').match('felt/20mms_first.csv')
    {'material': 'felt', 'speed': '20'}
    """

    text: str

    def __post_init__(self) -> None:
        names = [name for name in self.names if name]
        if len(set(names)) < len(names):
            raise InvalidParameter(f"the template '{self.text}' has a field twice; give each a name of its own")
        for part in self.text.split('/'):
            if '' in FIELD.sub('\0', part).split('\0')[1:-1]:
                raise InvalidParameter(f"the template '{self.text}' has fields without text between; put text there")

    @property
    def names(self) -> Sequence[str]:
        """Names of the fields in their order, '' for those that are not kept."""
        return [match[1] or ANYTHING for match in FIELD.finditer(self.text)]

    @property
    def depth(self) -> int:
        """Number of parts between slashes."""
        return self.text.count('/') + 1

    def match(self, name: str) -> dict[str, str] | None:
        """Return the fields of a name; None if it is not of this form."""
        parts = name.split('/')
        if len(parts) != self.depth:
            return None
        found: dict[str, str] = {}
        for template, part in zip(self.text.split('/'), parts, strict=True):
            fields = _fields(template, part)
            if fields is None:
                return None
            found |= fields
        return found


def _fields(template: str, text: str) -> Mapping[str, str] | None:
    names = [match[1] or ANYTHING for match in FIELD.finditer(template)]
    first, *literals = FIELD.sub('\0', template).split('\0')
    if not literals:
        return {} if text == template else None
    last = literals[-1]
    at, end = len(first), len(text) - len(last)
    if not text.startswith(first) or not text.endswith(last):
        return None
    found = {}
    for name, literal in zip(names, [*literals[:-1], None], strict=True):
        shortest = 1 if name else 0
        stop = end if literal is None else text.find(literal, at + shortest, end)
        if stop < at + shortest:
            return None
        if name:
            found[name] = text[at:stop]
        at = stop + len(literal or '')
    return found
