# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Draw a slide from a bag of /views/signal as PlotJuggler does: by header stamps, by readers independent of the suite.

The bag comes from `ros2 bag record --storage mcap --output slide /views/signal`, with `texture launch views` during an
exploration; then `pip install mcap-ros2-support matplotlib` and `python docs/pictures/views_signal.py slide`.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
from mcap_ros2.reader import read_ros2_messages

OUT = Path(__file__).with_suffix('.png')
ZOOM_S = 0.1


def read(folder: Path) -> tuple[list[float], list[float]]:
    """Return time, s, and value of the first channel of each message."""
    messages = [message.ros_msg for path in sorted(folder.glob('*.mcap')) for message in read_ros2_messages(path)]
    stamps_ns = [one.header.stamp.sec * 10**9 + one.header.stamp.nanosec for one in messages]
    return [(stamp_ns - stamps_ns[0]) * 1e-9 for stamp_ns in stamps_ns], [one.values[0] for one in messages]


def main() -> None:
    """Draw the whole slide, and a stretch of it with its samples."""
    times_s, values = read(Path(sys.argv[1]))
    figure, (whole, part) = plt.subplots(2, 1, figsize=(8, 4.5), layout='constrained')
    middle_s = times_s[-1] / 2
    whole.plot(times_s, values, linewidth=0.5)
    whole.axvspan(middle_s, middle_s + ZOOM_S, color='#e69f00', alpha=0.4)
    part.plot(times_s, values, marker='.', markersize=4, linewidth=0.8)
    part.set(xlim=(middle_s, middle_s + ZOOM_S), xlabel='time by the stamps of the messages, s')
    for axes in (whole, part):
        axes.set_ylabel('values[0]')
    figure.suptitle('/views/signal of a simulated slide, read with mcap-ros2-support')
    figure.savefig(OUT, dpi=110)


if __name__ == '__main__':
    main()
