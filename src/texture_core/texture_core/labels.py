"""What may be the label of a surface: it is shown, stored in file names and compared, so it is short and plain."""

from __future__ import annotations

from texture_core.errors import InvalidData

MAX_CHARACTERS = 100
# They separate folders, and the surface from the number of a slide.
FORBIDDEN = frozenset('/\\')
SHOWN_CHARACTERS = 40


def checked_label(label: str) -> str:
    """Return a label without the white space around it; '' stays ''.

    Parameters
    ----------
    label
        Name of a surface as a user gave it.

    Raises
    ------
    InvalidData
        If it is longer than 100 characters, or has a slash, a backslash or a character that cannot be printed.
    """
    label = label.strip()
    if len(label) > MAX_CHARACTERS:
        raise InvalidData(
            f"the label '{_shown(label)}' has {len(label)} characters; at most {MAX_CHARACTERS} are allowed"
        )
    if not label.isprintable() or FORBIDDEN.intersection(label):
        raise InvalidData(
            f"the label '{_shown(label)}' has a slash, a backslash or a character that cannot be printed; "
            'use letters, digits, spaces and punctuation'
        )
    return label


def _shown(label: str) -> str:
    """Return the beginning of a label, safe to print."""
    start = label[:SHOWN_CHARACTERS].encode('unicode_escape').decode()
    return start + '…' * (len(label) > SHOWN_CHARACTERS)
