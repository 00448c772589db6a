# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A preset: the motions of a paper or of a user, as a list of requests from one YAML file.

paper: where the numbers come from
motion: linear_slide
force_n: 2.5                    # any number of the request; 'direction_deg' and, for a slide, 'slide_s' as well
vary: {speed_m_s: [0.1, 0.2]}   # every combination is made
repeats: 50                     # how often each combination was made
"""

from __future__ import annotations

import itertools
import math
import typing
from collections.abc import Mapping
from typing import Any

from texture_core.config import find, find_file, load_yaml, safe_repr, unknown_name
from texture_core.errors import InvalidParameter
from texture_core.types import ExplorationRequest
from texture_exploration.motions import MOTIONS

KEYS = ('paper', 'motion', 'repeats', 'vary')
NUMBERS = tuple(name for name, kind in typing.get_type_hints(ExplorationRequest).items() if kind is float)
MOST = 10_000  # combinations, and repeats of them
LARGEST = 1e6  # number of a request; a larger one may not even be a float
SHORTHANDS = ('direction_deg', 'slide_s')


def load_preset(name_or_path: str, repeats: int = 0) -> list[ExplorationRequest]:
    """Return the requests of a preset that a package ships (config/presets), or of a file; raises as `read_preset`."""
    path = find_file(name_or_path, 'texture_exploration', 'config/presets', 'preset')
    content = load_yaml(path, 'preset')
    if not isinstance(content, Mapping):
        raise InvalidParameter(f"preset '{path.stem}': came {safe_repr(content)}; a mapping with a motion is needed")
    return read_preset(content, path.stem, repeats)


def read_preset(content: Mapping[str, Any], name: str, repeats: int = 0) -> list[ExplorationRequest]:
    """Return all requests in turn, each combination once per round; `repeats` of 0 means that of the preset."""
    where = f"preset '{name}'"
    vary = content.get('vary', {})
    if not (isinstance(vary, Mapping) and all(isinstance(values, list) and values for values in vary.values())):
        raise InvalidParameter(
            f"{where}: 'vary' is {safe_repr(vary)}; a mapping of names to lists is needed, each a list of numbers"
        )
    given = {key: value for key, value in content.items() if key not in KEYS}
    for key in (*given, *vary):
        if key not in (*NUMBERS, *SHORTHANDS):
            raise InvalidParameter(f'{where}: {unknown_name(str(key), (*KEYS, *NUMBERS, *SHORTHANDS), "key")}')
    motion = str(content.get('motion', ''))
    find(MOTIONS, motion, 'motion')
    rounds = content.get('repeats', 1)
    if not isinstance(rounds, int) or not 1 <= rounds <= MOST:
        raise InvalidParameter(f"{where}: 'repeats' is {safe_repr(rounds)}; a whole number from 1 to {MOST} is needed")
    combinations = math.prod(map(len, vary.values()))
    if combinations > MOST:
        raise InvalidParameter(f"{where}: 'vary' makes {combinations} combinations; at most {MOST} are made")
    requests = [
        _request(motion, {**given, **dict(zip(vary, values, strict=True))}, where)
        for values in itertools.product(*vary.values())
    ]
    return requests * (repeats or rounds)


def _request(motion: str, numbers: Mapping[str, Any], where: str) -> ExplorationRequest:
    for key, value in numbers.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise InvalidParameter(f"{where}: '{key}' is {safe_repr(value)}; a number is needed")
        if not abs(value) <= LARGEST:  # so is NaN
            raise InvalidParameter(f"{where}: '{key}' is {safe_repr(value)}; at most {LARGEST:g} is allowed")
    values: dict[str, Any] = {key: float(value) for key, value in numbers.items() if key not in SHORTHANDS}
    if 'direction_deg' in numbers:
        values['direction_rad'] = math.radians(numbers['direction_deg'])
    if 'slide_s' in numbers:
        if 'speed_m_s' not in values:
            raise InvalidParameter(f"{where}: 'slide_s' needs 'speed_m_s', from which the distance follows")
        values['distance_m'] = values['speed_m_s'] * numbers['slide_s']
    return ExplorationRequest(motion, use_start=bool({'start_x_m', 'start_y_m'} & values.keys()), **values)
