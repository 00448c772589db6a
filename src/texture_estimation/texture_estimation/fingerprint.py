"""Say in which part two fingerprints of feature sets differ."""

from __future__ import annotations

import re

PART = re.compile(r'(?P<topic>[^=\s]+)=(?P<rate>[^=*\s]+)Hz\*(?P<channels>\d+)')


def fingerprint_difference(came: str, trained: str) -> str:
    """Return what differs, in words; '' if nothing does.

    Parameters
    ----------
    came, trained
        Such as '3f9c12ab signal=2200Hz*1': of the feature vectors, and of the model.
    """
    if came == trained:
        return ''
    found, wanted = _inputs(came), _inputs(trained)
    if found.keys() != wanted.keys():
        return f'the inputs are {_listed(found)}, the model was trained on {_listed(wanted)}'
    for topic, (rate, channels) in found.items():
        trained_rate, trained_channels = wanted[topic]
        if rate != trained_rate:
            return f"the sampling rate of '{topic}' is {rate} Hz, the model was trained at {trained_rate} Hz"
        if channels != trained_channels:
            return f"'{topic}' has {channels} channels, the model was trained on {trained_channels}"
    return "features or window length are others; start the feature_extractor with the model's card as its recipe"


def _inputs(fingerprint: str) -> dict[str, tuple[str, str]]:
    return {match['topic']: (match['rate'], match['channels']) for match in PART.finditer(fingerprint)}


def _listed(inputs: dict[str, tuple[str, str]]) -> str:
    return ', '.join(inputs) or 'none'
