"""Find other people's message types at run time: the suite does not depend on their packages."""

from __future__ import annotations

import importlib
from typing import Any

from texture_core.errors import InvalidParameter


def import_message(message_type: str, parameter: str) -> Any:
    """Return the class of 'package/msg/Type', as a parameter of that name asks for.

    Raises
    ------
    InvalidParameter
        If it is not installed.
    """
    package, _, name = message_type.partition('/msg/')
    try:
        return getattr(importlib.import_module(f'{package}.msg'), name)
    except (ImportError, AttributeError) as error:
        raise InvalidParameter(
            f"parameter '{parameter}' asks for '{message_type}', which cannot be imported ({error}); build the package "
            'with these messages and source it, or name the type as package/msg/Type'
        ) from error
