"""Names of frames on tf, which know no namespaces of their own."""

from __future__ import annotations


def frame_name(namespace: str, name: str) -> str:
    """Return what a frame is called on tf that a node in a namespace calls `name`: 'left/fingertip'.

    Parameters
    ----------
    namespace
        Of the node, and of the finger below it, such as '/left/finger0'; '/' is the root.
    name
        A name with a '/' in it is that of tf already.

    Returns
    -------
    str

    Examples
    --------
    >>> frame_name('/left', 'fingertip'), frame_name('/', 'fingertip'), frame_name('/left', 'right/fingertip')
    ('left/fingertip', 'fingertip', 'right/fingertip')
    """
    if '/' in name or not name:
        return name
    return f'{namespace.strip("/")}/{name}'.lstrip('/')
