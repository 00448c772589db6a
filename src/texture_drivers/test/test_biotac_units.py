# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from texture_drivers.biotac import to_physical


def test_pressures_and_voltages_come_from_counts_by_the_nominal_scales() -> None:
    values, units = to_physical(np.array([[2130.0, 100.0, 4095.0, 7.0]]), ('pac', 'pdc', 'electrode1', 'tdc'))
    assert values[0] == pytest.approx([37.0, 3650.0, 3.3, 7.0])
    assert units == ['Pa', 'Pa', 'V', 'count']
