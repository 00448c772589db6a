"""Run a node inside a command, as if it had been started by itself."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from texture_core.ros.run import run


def run_node(make_node: Callable[[], Any], parameters: Mapping[str, Any], namespace: str = '') -> None:
    """Run a node with parameters until it ends or is told to stop.

    A user's error ends the program with exit code 2 and one sentence, as for any node.

    Parameters
    ----------
    make_node
        Makes the node when ROS is initialised.
    parameters
        Values of parameters by name.
    namespace
        Namespace of the node; '' for the root.
    """
    rules = [f'{name}:={json.dumps(value)}' for name, value in parameters.items()]  # JSON is YAML, strings quoted
    options = [part for rule in rules for part in ('-p', rule)]
    if namespace:
        options += ['-r', f'__ns:=/{namespace.strip("/")}']
    run(make_node, ['--ros-args', *options])
