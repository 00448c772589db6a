# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Launch files, configuration, the `texture` command, the dashboard and the demonstration.

Data in: arguments of launch files and commands. Data out: running nodes, sentences for people, and exit codes, which
are on the page of the commands (`docs/reference/commands.md`).

.. code-block:: sh

    texture demo
    texture launch emulator surface:=leather      # or: ros2 launch texture_bringup emulator.launch.xml surface:=leather
    texture explore linear_slide --speed 0.05 --distance 0.06
    texture dashboard
    eval "$(register-python-argcomplete texture)" # in ~/.bashrc: completes commands and options (python3-argcomplete)

Directions are in degrees in commands and on the dashboard, all else in SI units. A task shows its
progress after 3 s.

Limits: `respawn` never restarts a node that moves a robot. Other packages add commands through the entry point group
`texture.commands`.
"""
