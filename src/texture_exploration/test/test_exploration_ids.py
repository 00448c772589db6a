# SPDX-License-Identifier: Apache-2.0
import re

import numpy as np

from texture_exploration.explorer import ExplorationIds


def test_a_name_reports_the_time_and_the_number():
    identities = ExplorationIds(np.random.default_rng(1))
    names = [identities.next(0), identities.next(1_500_000_000)]
    assert re.fullmatch(r'19700101T000000-001-[0-9a-f]{4}', names[0])
    assert names[1].startswith('19700101T000001-002-')


def test_two_nodes_that_begin_at_once_give_different_names():
    assert ExplorationIds(np.random.default_rng(1)).next(0) != ExplorationIds(np.random.default_rng(2)).next(0)
