"""All motions by name."""

from __future__ import annotations

from collections.abc import Mapping

from texture_exploration.motions.linear_slide import linear_slide
from texture_exploration.motions.protocol import Planner

MOTIONS: Mapping[str, Planner] = {
    'linear_slide': linear_slide,  # ETS, Jamali & Sammut 2010, Hu et al. 2014
}
