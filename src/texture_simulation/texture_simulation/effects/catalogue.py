"""The effects by name, in the order in which they act."""

from __future__ import annotations

from collections.abc import Mapping

from texture_simulation.effects.contact_growth import ForceGain, PatchGrowth
from texture_simulation.effects.drift import Drift
from texture_simulation.effects.dropouts import Dropouts
from texture_simulation.effects.finger_spread import FingerSpread
from texture_simulation.effects.mains_hum import MainsHum
from texture_simulation.effects.motor_vibration import MotorVibration
from texture_simulation.effects.noise import Noise
from texture_simulation.effects.quantisation import Quantisation
from texture_simulation.effects.skids import Skids
from texture_simulation.effects.skin import Skin
from texture_simulation.effects.slide_error import SlideError
from texture_simulation.effects.unevenness import Unevenness

EFFECTS: Mapping[str, type] = {
    'slide_error': SlideError,  # the robot is faster or slower, presses harder or less than it should
    'skids': Skids,  # the skin sticks for a moment and jumps after
    'patch_growth': PatchGrowth,  # a harder pressed finger senses fine textures less
    'force_gain': ForceGain,  # a harder pressed finger senses textures more
    'unevenness': Unevenness,  # no sample is everywhere the same
    'finger_spread': FingerSpread,  # no finger is as sensitive as another
    'motor_vibration': MotorVibration,  # a ripple of the force with the way
    'skin': Skin,  # resonance of mass, spring and damper
    'noise': Noise,  # of the electronics
    'mains_hum': MainsHum,  # 50 or 60 Hz
    'drift': Drift,  # a baseline that wanders
    'dropouts': Dropouts,  # moments in which the signal stands still
    'quantisation': Quantisation,  # steps of several counts
}
