# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Draw a slide from a bag of /views/signal as PlotJuggler does: by header stamps, by readers independent of the suite.

The bag comes from `texture record --all slide`, with `texture launch views` during an exploration; then
`pip install mcap-ros2-support matplotlib` and `python docs/pictures/views_signal.py slide`.
"""

import sys
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from mcap_ros2.reader import read_ros2_messages

OUT = Path(__file__).with_suffix('.png')
ZOOM_S = 0.1
SLIDE = 3  # PHASE_SLIDE of ExplorationState.msg


def read(folder: Path, topic: str) -> list[tuple[float, Any]]:
    """Return time, s, and message of a topic."""
    found = [one.ros_msg for path in sorted(folder.glob('*.mcap')) for one in read_ros2_messages(path, [topic])]
    return [(one.header.stamp.sec + 1e-9 * one.header.stamp.nanosec, one) for one in found]


def main() -> None:
    """Draw the whole slide, and a stretch of it with its samples."""
    slide_s = [stamp_s for stamp_s, state in read(Path(sys.argv[1]), '/exploration') if state.phase == SLIDE]
    samples = [(stamp_s - slide_s[0], one.values[0]) for stamp_s, one in read(Path(sys.argv[1]), '/views/signal')]
    times_s, values = zip(*[one for one in samples if 0 <= one[0] <= slide_s[-1] - slide_s[0]], strict=True)
    figure, (whole, part) = plt.subplots(2, 1, figsize=(5.7, 4.6), layout='constrained')
    middle_s = times_s[-1] / 2
    whole.plot(times_s, values, linewidth=0.5)
    whole.axvspan(middle_s, middle_s + ZOOM_S, color='#e69f00', alpha=0.4)
    part.plot(times_s, values, marker='.', markersize=4, linewidth=0.8)
    part.set(xlim=(middle_s, middle_s + ZOOM_S), xlabel='time by the header stamps (s)')
    for axes in (whole, part):
        axes.set_ylabel('values[0]')
    figure.suptitle('/views/signal of a simulated slide')
    figure.savefig(OUT, dpi=150)


if __name__ == '__main__':
    main()
