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
import yaml
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse, Rectangle

from texture_core.config import find_file, load_yaml
from texture_core.types import Array, TextureEstimate
from texture_estimation.model import load_model
from texture_evaluation.charts import COLOURS
from texture_evaluation.evaluate import run_model
from texture_evaluation.train import train_from_bags
from texture_recordings.dataset import SlideDataset
from texture_simulation.offline import SlidePlan, write_simulated

SCENE = 'twelve_textures'
TRAINED = ('leather', 'woven_cloth', 'grid_2mm', 'sandpaper_fine', 'sandpaper_coarse', 'brushed_metal', 'glass')
SHOWN = ('sandpaper_coarse', 'cardboard')
UNTRAINED = SHOWN[1]
PLAN = SlidePlan(slides=26, slide_s=1.6, speed_m_s=0.05, force_n=1.0)
WINDOWS = {'length_s': 0.04, 'hop_s': 0.02}  # shorter than those of `default`, so that the evidence is seen to grow
RATE_HZ, FRAMES_PER_S, HOLD_S = 1000.0, 12, 2.0
SLOWER = 1.5  # than real
GREEN, RED = '#00704a', '#b3331f'
OUT = Path(__file__).with_name('recognition.gif')


@dataclass(frozen=True)
class Shown:
    """One slide to draw: its samples, (n_samples,), its estimates with evidence, and the labels of the model."""

    surface: str
    samples: Array
    estimates: list[TextureEstimate]
    labels: tuple[str, ...]

    @property
    def duration_s(self) -> float:
        """How long the finger slides."""
        return self.estimates[-1].evidence_s


def tested_slides(folder: Path) -> list[Shown]:
    """Return slides that the model has not seen: number 25 of each shown surface, trained on 1 to 20."""
    bags = write_simulated(folder, PLAN, np.random.default_rng(3), scene=SCENE, surfaces=(*TRAINED, UNTRAINED))
    dataset = SlideDataset.from_bags(bags)
    trained = [bag for bag in bags if UNTRAINED not in bag.name]
    recipe = load_yaml(find_file('default', 'texture_estimation', 'config/recipes', 'recipe'), 'recipe')
    (folder / 'short.yaml').write_text(yaml.safe_dump({**recipe, 'windows': WINDOWS}))
    train_from_bags(str(folder / 'short.yaml'), trained, '1-20', folder / 'model')
    model = load_model(str(folder / 'model'))
    shown = []
    for surface in SHOWN:
        slides = dataset.select('25', labels=[surface])
        [(_, events)] = slides.windows(model.recipe.feature_set)
        estimates = [estimate for estimate in run_model(model, events)[1] if estimate.probabilities]
        shown.append(Shown(surface, slides.samples('signal')[0].samples[:, 0], estimates, tuple(model.labels)))
    return shown


class Panel:
    """One column: finger on the surface, signal, probabilities, verdict."""

    def __init__(self, shown: Shown, scene: Axes, signal: Axes, probability: Axes, title: str) -> None:
        self._shown = shown
        end_s = shown.duration_s
        scene.set(xlim=(0, 1.3 * end_s), ylim=(0, 1))
        scene.set_axis_off()
        scene.set_title(title, fontsize=12, loc='left')
        rng = np.random.default_rng(len(shown.surface))
        ground = 0.22 + 0.05 * rng.random(160)
        scene.fill_between(np.linspace(0, 1.3 * end_s, 160), ground, color='#c9b79c', linewidth=0)
        self._finger = [
            scene.add_patch(Ellipse((0, 0.55), 0.20 * end_s, 0.66, color='#444444')),
            scene.add_patch(Rectangle((0, 0.6), 0.20 * end_s, 0.5, color='#444444')),
        ]
        self._seconds = np.arange(len(shown.samples)) / RATE_HZ
        [self._trace] = signal.plot([], [], color=COLOURS[0], linewidth=0.5)
        top = 1.05 * np.abs(shown.samples[self._seconds <= end_s]).max()
        signal.set(xlim=scene.get_xlim(), ylim=(-top, top), yticks=[], xticks=[])
        signal.set_ylabel('signal', fontsize=12)
        probability.set(xlim=scene.get_xlim(), ylim=(0, 1.04), yticks=[0, 0.5, 1])
        probability.set_xlabel('sliding time (s)', fontsize=12)
        probability.set_ylabel('probability among\ntrained surfaces', fontsize=12)
        colours = dict(zip(shown.labels, COLOURS, strict=False))
        self._lines = {name: probability.plot([], [], color=colours[name], linewidth=2.2)[0] for name in shown.labels}
        style = {'fontsize': 12, 'va': 'center', 'ha': 'right'}
        self._names = {name: probability.text(0, 0, '', color=colours[name], **style) for name in colours}
        self._verdict = probability.text(
            0.97, 0.5, '', fontsize=13, fontweight='bold', ha='right', va='center', transform=probability.transAxes
        )

    def draw(self, now_s: float) -> None:
        """Show the slide as it is after some seconds; before it begins, the finger waits."""
        now_s = min(max(now_s, 0.0), self._shown.duration_s)
        width = 0.20 * self._shown.duration_s
        at = 0.5 * width + now_s * (1.3 - 0.2) * 0.9
        self._finger[0].set_center((at, 0.55))
        self._finger[1].set_xy((at - 0.5 * width, 0.6))
        self._trace.set_data(self._seconds[self._seconds <= now_s], self._shown.samples[self._seconds <= now_s])
        known = [estimate for estimate in self._shown.estimates if estimate.evidence_s <= now_s + 1e-9]
        seconds = [0.0, *(estimate.evidence_s for estimate in known)]
        equal = 1.0 / len(self._lines)
        finals = {}
        for number, (name, line) in enumerate(self._lines.items()):
            values = [equal, *(estimate.probabilities[number] for estimate in known)]
            line.set_data(seconds, values)
            finals[name] = values[-1]
        # Labels below the ends of the lines, the likeliest at its height and the rest below each other.
        height = 1.0
        for name in sorted(finals, key=finals.__getitem__, reverse=True):
            height = min(height, finals[name] + 0.12)
            shown = known and (finals[name] > 0.04 or name == max(finals, key=finals.__getitem__))
            self._names[name].set(position=(1.28 * self._shown.duration_s, height - 0.1), text=name if shown else '')
            height -= 0.13
        if now_s < self._shown.duration_s:
            self._verdict.set_text('')
            return
        last = self._shown.estimates[-1]
        accepted = last.rejection.name == 'NONE'
        reason = last.rejection.name.lower().replace('_', ' ')
        text = f'accepted:\n{last.label}' if accepted else f'rejected: {reason}\n(nearest: {last.label})'
        self._verdict.set(text=text, color=GREEN if accepted else RED)


def animate(slides: list[Shown], path: Path) -> None:
    """Write the animation: both slides at the same time, then both results."""
    figure, axes = plt.subplots(3, 2, figsize=(6.4, 4.4), height_ratios=(2.4, 1.3, 3), layout='constrained')
    figure.suptitle(
        f'simulated TSF-85, windows of {1e3 * WINDOWS["length_s"]:g} ms, slowed {SLOWER:g} times', fontsize=12
    )
    titles = (f'{SHOWN[0]}: trained', f'{SHOWN[1]}: never trained')
    panels = [Panel(slide, *column, title) for slide, column, title in zip(slides, axes.T, titles, strict=True)]
    for axis in axes[1:].ravel():
        axis.spines[['top', 'right']].set_visible(False)
        axis.tick_params(labelsize=11)
    end_s = max(slide.duration_s for slide in slides)

    def draw(frame: int) -> None:
        for panel in panels:
            panel.draw(frame / FRAMES_PER_S / SLOWER if frame >= 0 else end_s)

    moving = range(round(end_s * FRAMES_PER_S * SLOWER))
    hold = [-1] * round(HOLD_S * FRAMES_PER_S)
    FuncAnimation(figure, draw, frames=[-1, *moving, *hold]).save(path, PillowWriter(FRAMES_PER_S), dpi=112)


if __name__ == '__main__':
    with tempfile.TemporaryDirectory() as place:
        animate(tested_slides(Path(place)), OUT)
