"""What a launch file asks for, with everything substituted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Argument:
    """An argument that a launch file declares; `default` None makes it required."""

    name: str
    default: str | None
    description: str


@dataclass(frozen=True)
class NodeDescription:
    """One node to run.

    `namespace` is absolute, or '' where the file names none. Each item of `parameters` is a parameter file or a
    mapping of names to values; later ones override earlier ones. `environment` is the whole environment of the process.
    """

    package: str
    executable: str
    name: str = ''
    namespace: str = ''
    arguments: tuple[str, ...] = ()
    parameters: tuple[Path | Mapping[str, Any], ...] = ()
    remappings: tuple[tuple[str, str], ...] = ()
    screen: bool = False
    respawn: bool = False
    respawn_delay_s: float = 0.0
    needed: bool = False
    environment: Mapping[str, str] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """How the node is called in the output: its full name as far as the file gives it."""
        name = self.name or self.executable
        return f'{self.namespace.lstrip("/")}/{name}'.lstrip('/')

    @property
    def parameter_key(self) -> str:
        """The key of its parameters in a parameter file: its full name if known, else every node of the process."""
        if not (self.name and self.namespace):
            return '/**'
        return f'{self.namespace.rstrip("/")}/{self.name}'
