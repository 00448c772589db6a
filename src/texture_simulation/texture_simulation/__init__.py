# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Simulated surfaces, contact and sensors, and devices emulated at protocol level, so that drivers run unchanged.

Data in: a scene (YAML) with surfaces, finger and effects. Data out: the bytes of an emulated device, or labelled
recordings, made offline and hundreds of times faster than real time.

.. code-block:: python

    import numpy as np
    from texture_simulation.offline import simulate_exploration
    from texture_simulation.scene import load_scene

    scene = load_scene('twelve_textures')
    rng = np.random.default_rng(0)
    states, signals = simulate_exploration(
        scene, 'ridge_2mm_deep', 0.1, 2.0, 1.0, start_ns=0, exploration_id='one', rng=rng
    )

With ROS: `ros2 run texture_simulation emulator --ros-args -p surface:=ridge_2mm_deep`

Limits: sensitivities and sizes of samples are guesses of the usual order (`docs/simulation.md`).
"""
