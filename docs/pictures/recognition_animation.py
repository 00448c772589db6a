# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Draw docs/pictures/recognition.gif: `.venv/bin/ros-run python docs/pictures/recognition_animation.py`, a minute.

Two simulated slides of a TSF-85 fingertip that the model has not seen: one over a trained surface, one over a surface
that was never trained. The first frame is the finished picture, for readers whose viewer shows no animation.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse, Rectangle
from PIL import Image

from texture_bringup.feed import in_words
from texture_core.types import Array, Rejection, TextureEstimate
from texture_estimation.model import load_model
from texture_evaluation.charts import COLOURS
from texture_evaluation.evaluate import run_model
from texture_evaluation.train import train_from_bags
from texture_recordings.dataset import SlideDataset
from texture_simulation.offline import SlidePlan, write_simulated
from texture_simulation.scene import load_scene

SCENE, RECIPE = 'twelve_textures', 'default'
TRAINED = ('leather', 'woven_cloth', 'grid_2mm', 'sandpaper_fine', 'sandpaper_coarse', 'brushed_metal', 'glass')
SHOWN = {'sandpaper_coarse': 'trained', 'cardboard': 'never trained'}
UNTRAINED = 'cardboard'
PLAN = SlidePlan(slides=51, slide_s=1.25, speed_m_s=0.05, force_n=1.0)
TRAINING, TESTED = '1-50', '51'  # slides of each surface
RATE_HZ, FRAMES_PER_S, HOLD_S = 1000.0, 12, 4.0
SLOWER = 3.0  # than real
FINGER_M, MARGIN_M = 0.010, 0.008  # width of the finger, and what is seen of the surface before and behind the slide
ENLARGED = 1500.0  # relief, in heights of the drawing per m
FILLS = {'sandpaper_coarse': ('#b08d6a', '....'), 'cardboard': ('#e6cfa5', '')}  # colour, hatch
GREEN, RED, GREY, DARK, LIGHT = '#00704a', '#b3331f', '#666666', '#444444', '#dddddd'
TONES = 128  # of the palette
OUT = Path(__file__).with_name('recognition.gif')


@dataclass(frozen=True)
class Shown:
    """One slide to draw: samples, (n_samples,), estimates with evidence up to its end, and the labels of the model."""

    surface: str
    samples: Array
    estimates: list[TextureEstimate]
    labels: tuple[str, ...]

    @property
    def end_s(self) -> float:
        """How long the finger slides."""
        return self.estimates[-1].evidence_s


def tested_slides(folder: Path) -> list[Shown]:
    """Return slides that the model has not seen, each up to where `early_stopping` ends it."""
    bags = write_simulated(folder, PLAN, np.random.default_rng(3), scene=SCENE, surfaces=(*TRAINED, UNTRAINED))
    dataset = SlideDataset.from_bags(bags)
    train_from_bags(RECIPE, [bag for bag in bags if UNTRAINED not in bag.name], TRAINING, folder / 'model')
    model = load_model(str(folder / 'model'))
    shown = []
    for surface in SHOWN:
        slides = dataset.select(TESTED, labels=[surface])
        [(_, events)] = slides.windows(model.recipe.feature_set)
        estimates = [estimate for estimate in run_model(model, events)[1] if estimate.probabilities]
        decided = next((number for number, estimate in enumerate(estimates) if estimate.decided), len(estimates))
        samples = slides.samples('signal')[0].samples[:, 0]
        shown.append(Shown(surface, samples, estimates[: decided + 1], tuple(model.labels)))
    return shown


class Panel:
    """One column: finger on the surface, signal, probabilities, verdict."""

    def __init__(self, shown: Shown, scene: Axes, signal: Axes, probability: Axes) -> None:
        self._shown, self._probability = shown, probability
        # The scene lies above the signal: where the finger is, its signal ends.
        from_m, to_m = -MARGIN_M, PLAN.slide_s * PLAN.speed_m_s + MARGIN_M
        scene.set(xlim=(from_m, to_m), ylim=(0, 1))
        scene.set_axis_off()
        scene.set_title(f'{shown.surface}:\n{SHOWN[shown.surface]}', fontsize=12, loc='left')
        x_m = np.linspace(from_m, to_m, 1500)
        relief_m = load_scene(SCENE).surface(shown.surface).height_m(x_m, np.zeros_like(x_m), np.full_like(x_m, 5e-5))
        colour, hatch = FILLS[shown.surface]
        style = {'facecolor': colour, 'edgecolor': DARK, 'hatch': hatch, 'linewidth': 1.0}
        scene.fill_between(x_m, 0.22 + ENLARGED * relief_m, -0.1, **style)
        self._finger = scene.add_patch(Ellipse((0, 0), FINGER_M, 0.5, color=DARK))
        self._shaft = scene.add_patch(Rectangle((0, 0), FINGER_M, 1.0, color=DARK))
        words = {'color': 'white', 'rotation': 90, 'ha': 'center', 'va': 'center', 'fontsize': 11}
        self._name = scene.text(0, 0, 'finger', **words)
        self._seconds = np.arange(len(shown.samples)) / RATE_HZ
        [self._trace] = signal.plot([], [], color=COLOURS[0], linewidth=0.5)
        signal.set(xlim=(from_m / PLAN.speed_m_s, to_m / PLAN.speed_m_s), xticks=[0, 0.5, 1], yticks=[])
        signal.set_xlabel('sliding time (s)', fontsize=12)
        self._bars = probability.barh(shown.labels, np.zeros(len(shown.labels)), height=0.7)
        probability.set(xlim=(0, 1), xticks=[0, 0.5, 1])

    def draw(self, now_s: float) -> None:
        """Show the slide as it is after some seconds; at its end the finger lifts."""
        shown = self._shown
        over, now_s = now_s >= shown.end_s, min(now_s, shown.end_s)
        at_m, height = now_s * PLAN.speed_m_s, 0.60 if over else 0.47
        self._finger.set_center((at_m, height))
        self._shaft.set_xy((at_m - 0.5 * FINGER_M, height))
        self._name.set_position((at_m, height + 0.12))
        past = self._seconds <= now_s
        self._trace.set_data(self._seconds[past], shown.samples[past])
        known = [estimate for estimate in shown.estimates if estimate.evidence_s <= now_s + 1e-9]
        if not known:
            self._show([0.0] * len(shown.labels), LIGHT, 'no estimate before\nthe first 0.5 s', GREY)
            return
        last = known[-1]
        accepted = last.rejection is Rejection.NONE
        said = last.label if accepted else in_words(last.rejection)
        colour = (GREEN if accepted else RED) if over else GREY
        end = (
            f'{"accepted" if accepted else "rejected"} after {now_s:.1f} s:\n{said}'
            if over
            else 'undecided,\nslide goes on'
        )
        self._show(last.probabilities, colour, end, colour)

    def _show(self, probabilities: Array, bar: str, text: str, colour: str) -> None:
        best = int(np.argmax(probabilities))
        for number, (rectangle, width) in enumerate(zip(self._bars, probabilities, strict=True)):
            rectangle.set(width=width, color=bar if number == best else '#aaaaaa')
        self._probability.set_title(text, color=colour, fontsize=12, fontweight='bold', loc='left')


def animate(slides: list[Shown], path: Path) -> None:
    """Write the animation: both results, then both slides at the same time."""
    style = {'figsize': (6.4, 5.4), 'height_ratios': (2.0, 1.0, 2.6), 'layout': 'constrained', 'dpi': 112}
    figure, axes = plt.subplots(3, 2, sharey='row', **style)
    figure.suptitle(f'Simulated TSF-85, recipe {RECIPE}, slowed {SLOWER:g} times', fontsize=12)
    panels = [Panel(slide, *column) for slide, column in zip(slides, axes.T, strict=True)]
    figure.supxlabel('probability among the trained surfaces', fontsize=12)
    top = 1.05 * max(np.abs(slide.samples).max() for slide in slides)
    axes[1, 0].set_ylim(-top, top)
    axes[1, 0].set_ylabel('signal', fontsize=12)
    for axis in axes[1:].ravel():
        axis.spines[['top', 'right']].set_visible(False)
        axis.tick_params(labelsize=11)
    end_s = max(slide.end_s for slide in slides)
    moving = np.arange(0.0, end_s, 1.0 / FRAMES_PER_S / SLOWER)
    pictures = []
    for now_s in (end_s, *moving, end_s):
        for panel in panels:
            panel.draw(now_s)
        figure.canvas.draw()
        pictures.append(Image.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert('RGB'))
    # All in the colours of the finished picture and without dithering, which would not compress.
    palette = pictures[0].quantize(TONES)
    frames = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    shown_ms = [round(1e3 * HOLD_S), *[round(1e3 / FRAMES_PER_S)] * len(moving), round(1e3 * HOLD_S)]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=shown_ms, loop=0, optimize=True)


if __name__ == '__main__':
    with tempfile.TemporaryDirectory() as place:
        animate(tested_slides(Path(place)), OUT)
