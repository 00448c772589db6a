# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The C++ in docs/sensors.md is what people will copy: it must make frames that the driver takes."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from texture_core.framing import FrameDecoder

PAGE = Path(__file__).resolve().parents[3] / 'docs' / 'sensors.md'
COMPILER = shutil.which('g++')
# Reads rows of 8 samples and writes frames of 10 rows.
MAIN = """
#include <cstdio>
int main() {
  int16_t samples[80];
  uint8_t out[400];
  for (uint32_t i = 65530; fread(samples, 16, 10, stdin) == 10; i++)
    fwrite(out, 1, make_frame(1, uint16_t(i), i * 4000, 10, 8, samples, sizeof samples, out), stdout);
}
"""


@pytest.mark.skipif(COMPILER is None or not PAGE.exists(), reason='needs g++ and the documentation')
def test_the_example_makes_frames_that_the_driver_takes(tmp_path: Path) -> None:
    example = re.search(r'```cpp\n(.*?)```', PAGE.read_text(), re.DOTALL)
    assert example
    (tmp_path / 'device.cpp').write_text(example[1] + MAIN)
    program = tmp_path / 'device'
    subprocess.run([str(COMPILER), '-Wall', '-Werror', '-o', program, tmp_path / 'device.cpp'], check=True)
    rng = np.random.default_rng(0)
    samples = rng.integers(-3, 300, (200, 8)).astype('<i2')  # many zero bytes
    samples[100:] = rng.integers(1, 256, (100, 8)).astype('<i2') * 257  # none at all
    line = subprocess.run([program], input=samples.tobytes(), capture_output=True, check=True).stdout
    deframer = FrameDecoder()
    frames = deframer.feed(line)
    assert b''.join(frame.body for frame in frames) == samples.tobytes()
    assert [frame.sequence for frame in frames] == [(65530 + i) % 65536 for i in range(20)]
    assert (deframer.bad_frames, deframer.lost) == (0, 0)
