"""All motions by name."""

from __future__ import annotations

from collections.abc import Mapping

from texture_exploration.motions.circular import circular
from texture_exploration.motions.cross_slide import cross_slide
from texture_exploration.motions.in_hand_sliding import in_hand_random, in_hand_sliding
from texture_exploration.motions.linear_slide import linear_slide
from texture_exploration.motions.protocol import Planner

MOTIONS: Mapping[str, Planner] = {
    'linear_slide': linear_slide,  # ETS, Jamali & Sammut 2010, Hu et al. 2014
    'circular': circular,  # ETS
    'cross_slide': cross_slide,  # Hu et al. 2014: along x and along y
    'in_hand_sliding': in_hand_sliding,  # Kaboli et al. 2015
    'in_hand_random': in_hand_random,  # its future work: random exploratory movements
}
