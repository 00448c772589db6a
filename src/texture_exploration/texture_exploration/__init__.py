# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Exploratory motions, the robots that perform them, and their safety.

Data in: an `ExplorationRequest` with speed in m/s, force in N and lengths in m. Data out: `ExplorationState`, which
is the state of the finger and the time for which speed and force are guaranteed, and an outcome in one sentence.

.. code-block:: python

    from texture_core.types import ExplorationRequest
    from texture_exploration.arms.simulated import SimulatedArm
    from texture_exploration.explorer import Explorer
    from texture_exploration.safety import SafetyLimits
    from texture_exploration.touch import TouchParams

    explorer = Explorer(SimulatedArm(), TouchParams(), SafetyLimits(), on_state=print)
    explorer.connect()
    exploration = explorer.begin('my-first', ExplorationRequest('linear_slide', distance_m=0.05))
    exploration.ended.wait()
    print(exploration.outcome)

With ROS: `ros2 run texture_exploration explorer --ros-args -p arm:=simulated`

Limits: nothing here has run on real hardware yet, and nothing is a safety function: `docs/safety.md`.
Arm and sensor are fixed when the node starts; other parameters change with the next exploration.
"""
