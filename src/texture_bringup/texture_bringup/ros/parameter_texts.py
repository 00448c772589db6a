"""Parameters of a node from texts, by the types that the node has declared."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import ParameterType
from rclpy.parameter import Parameter

from texture_core.errors import InvalidParameter

BOOLEANS = {'true': True, 'false': False}
# What reads a text, and what is allowed, by the type of the parameter.
READERS: dict[int, tuple[Callable[[str], Any], str]] = {
    ParameterType.PARAMETER_BOOL: (lambda text: BOOLEANS[text.lower()], 'true or false'),
    ParameterType.PARAMETER_INTEGER: (int, 'a whole number'),
    ParameterType.PARAMETER_DOUBLE: (float, 'a number'),
    ParameterType.PARAMETER_STRING: (str, 'any text'),
}


def parameter_from_text(name: str, text: str, kind: int) -> Parameter:
    """Return a parameter of a declared type.

    Parameters
    ----------
    name
        Name of the parameter.
    text
        Its value, as an operator writes it.
    kind
        Type of `rcl_interfaces.msg.ParameterType`.

    Returns
    -------
    Parameter

    Raises
    ------
    InvalidParameter
        If its type cannot be read from a text, or the text is no such value.
    """
    if kind not in READERS:
        raise InvalidParameter(f"parameter '{name}' is a list, which cannot be set from a text; give it at the start")
    read, allowed = READERS[kind]
    try:
        return Parameter(name, value=read(text))
    except (ValueError, KeyError):
        raise InvalidParameter(f"parameter '{name}' is '{text}'; allowed is {allowed}") from None
