# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Draw docs/pictures/evidence.gif: `.venv/bin/ros-run python docs/pictures/evidence_animation.py`, a minute.

It shows a simulated slide of a TSF-85 fingertip over a grid of the scene `ets_linear`, and how the evidence of a model
grows while the finger slides. The textures of this scene are hard to distinguish, so a decision needs several windows.
"""

from __future__ import annotations

import tempfile
from itertools import pairwise
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter

from texture_core.types import Array, TextureEstimate
from texture_estimation.model import load_model
from texture_evaluation.charts import COLOURS
from texture_evaluation.evaluate import run_model
from texture_evaluation.train import train_from_bags
from texture_recordings.dataset import SlideDataset
from texture_simulation.offline import SlidePlan, write_simulated

SCENE, SURFACE, TRAINING, TESTED = 'ets_linear', 'grid_1', '1-20', '25'
PLAN = SlidePlan(slides=28, slide_s=2.0, speed_m_s=0.05, force_n=1.0)
RATE_HZ = 1000.0
FRAMES_PER_S = 10
OUT = Path(__file__).with_name('evidence.gif')


def tested_slide(folder: Path) -> tuple[Array, list[TextureEstimate]]:
    """Return the samples of one tested slide, (n_samples,), and its estimates; the model has not seen it."""
    bags = write_simulated(folder, PLAN, np.random.default_rng(3), scene=SCENE)
    train_from_bags('fast', bags, TRAINING, folder / 'model')
    model = load_model(str(folder / 'model'))
    slides = SlideDataset.from_bags(bags).select(TESTED, labels=[SURFACE])
    [(_, events)] = slides.windows(model.recipe.feature_set)
    estimates = [estimate for estimate in run_model(model, events)[1] if estimate.probabilities]
    return slides.samples('signal')[0].samples[:, 0], estimates


def label_heights(percent: Array) -> Array:
    """Return heights of the labels beside the ends of the lines, (n,), at least 7 apart so that all can be read."""
    heights = np.array(percent, dtype=float)
    order = np.argsort(heights)
    heights[order[0]] = max(heights[order[0]], 4.0)
    for below, above in pairwise(order):
        heights[above] = max(heights[above], heights[below] + 7.0)
    return heights


def animate(samples: Array, estimates: list[TextureEstimate], path: Path) -> None:
    """Write the animation: the signal so far above, the probability of each texture so far below."""
    figure, (signal, evidence) = plt.subplots(2, 1, figsize=(7.2, 4.6), height_ratios=(2, 3), layout='constrained')
    figure.suptitle(f'Simulated slide over {SURFACE}: the evidence grows while the finger slides', fontsize=11)
    seconds = np.arange(len(samples)) / RATE_HZ
    used = np.array([estimate.evidence_s for estimate in estimates])
    percent = 100 * np.array([estimate.probabilities for estimate in estimates])
    [trace] = signal.plot([], [], color=COLOURS[0], linewidth=0.6)
    signal.set(xlim=(0, used[-1]), ylim=(samples.min(), samples.max()), ylabel='signal (count)')
    evidence.set(xlim=(0, used[-1] * 1.18), ylim=(0, 100), xlabel='sliding time (s)', ylabel='probability (%)')
    signal.set_xlim(evidence.get_xlim())
    lines = [evidence.plot([], [], marker='.', color=colour)[0] for colour in COLOURS[: percent.shape[1]]]
    names = [evidence.text(0, 0, '', color=line.get_color(), va='center') for line in lines]

    def draw(frame: int) -> None:
        now = frame / FRAMES_PER_S
        trace.set_data(seconds[seconds <= now], samples[seconds <= now])
        shown = used <= now + 1e-9
        heights = label_heights(percent[shown][-1]) if shown.any() else []
        for column, (line, name) in enumerate(zip(lines, names, strict=True)):
            line.set_data(used[shown], percent[shown, column])
            if shown.any():
                name.set(position=(used[shown][-1] + 0.03, heights[column]), text=estimates[0].labels[column])

    frames = [*range(round(used[-1] * FRAMES_PER_S) + 1), *[round(used[-1] * FRAMES_PER_S)] * 15]
    FuncAnimation(figure, draw, frames=frames).save(path, PillowWriter(FRAMES_PER_S), dpi=100)


if __name__ == '__main__':
    with tempfile.TemporaryDirectory() as place:
        animate(*tested_slide(Path(place)), OUT)
