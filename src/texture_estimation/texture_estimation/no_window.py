"""The sentence of a final estimate that no window of the slide could be used for."""

from __future__ import annotations

from texture_features.windowing.windows import WindowParams


def no_window(windows: WindowParams) -> str:
    """Return why a slide ended without a window, how long it must be, and what to do.

    Parameters
    ----------
    windows
        How the recipe of the model cuts windows.

    Returns
    -------
    str

    Examples
    --------
    >>> no_window(WindowParams(length_s=0.5)).partition('; ')[0]
    'no window could be used: the slide was shorter than the 0.5 s of a window, or its samples were lost'
    """
    skip_s, length_s = windows.skip_s, windows.length_s
    needed = (
        f'{skip_s + length_s:g} s, the first {skip_s:g} s and a window' if skip_s else f'the {length_s:g} s of a window'
    )
    return (
        f'no window could be used: the slide was shorter than {needed}, or its samples were lost; '
        'slide longer or more slowly'
    )
