"""What a launch file can refer to at one place: variables, environment, namespace, packages."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from texture_core.catalogue import find, unknown_name
from texture_core.errors import InvalidLaunch
from texture_launch import packages, template


@dataclass
class Scope:
    """Variables, environment and namespace; elements change them for what follows in the same scope."""

    variables: dict[str, str]
    environment: dict[str, str]
    namespace: str = ''

    def copy(self) -> Scope:
        """Return a scope whose changes do not reach this one."""
        return dataclasses.replace(self, variables=dict(self.variables), environment=dict(self.environment))

    def expand(self, text: str) -> str:
        """Return a text with its substitutions performed."""
        return template.expand(template.parse(text), self.perform)

    def perform(self, name: str, arguments: Sequence[str]) -> str:
        """Return what one substitution stands for.

        Raises
        ------
        UnknownName, InvalidLaunch
            If there is no such substitution, variable or package, or the number of arguments is wrong.
        """
        substitution = find(SUBSTITUTIONS, name, 'substitution')
        if not substitution.fewest <= len(arguments) <= substitution.most:
            raise InvalidLaunch(
                f'$({" ".join([name, *arguments])}) has {len(arguments)} arguments; '
                f'{substitution.fewest} to {substitution.most} are needed'
            )
        return substitution.perform(self, arguments)


def _variable(scope: Scope, arguments: Sequence[str]) -> str:
    name, *default = arguments
    if name not in scope.variables and not default:
        raise unknown_name(name, scope.variables, 'launch variable')
    return scope.variables.get(name, *default)


def _environment(scope: Scope, arguments: Sequence[str]) -> str:
    name, *default = arguments
    if name not in scope.environment and not default:
        raise InvalidLaunch(
            f"environment variable '{name}' is not set; set it, or give a default: $(env {name} DEFAULT)"
        )
    return scope.environment.get(name, *default)


def _find_share(_scope: Scope, arguments: Sequence[str]) -> str:
    return str(packages.share(arguments[0]))


def _not_equals(_scope: Scope, arguments: Sequence[str]) -> str:
    left, right = arguments
    return 'true' if left != right else 'false'


@dataclass(frozen=True)
class Substitution:
    """How a call is performed, and how many arguments it takes."""

    perform: Callable[[Scope, Sequence[str]], str]
    fewest: int
    most: int


SUBSTITUTIONS: Mapping[str, Substitution] = {
    'var': Substitution(_variable, 1, 2),
    'env': Substitution(_environment, 1, 2),
    'find-pkg-share': Substitution(_find_share, 1, 1),
    'not-equals': Substitution(_not_equals, 2, 2),
}
