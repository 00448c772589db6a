"""Who may use the page: requests of this page alone, and beyond loopback only with the token."""

from __future__ import annotations

import hmac
import ipaddress
import os
import secrets
import socket
from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import urlsplit

from texture_core.errors import InvalidParameter

TOKEN_VARIABLE = 'TEXTURE_DASHBOARD_TOKEN'
COOKIE = 'texture_token'
MIN_TOKEN = 16


@dataclass(frozen=True)
class Access:
    """What is asked of a request.

    Parameters
    ----------
    host
        Address the server is bound to.
    token
        Secret of the page; needed as soon as others can reach the server.
    names
        Names of this machine by which it may be called beside 'localhost' and addresses.

    Raises
    ------
    InvalidParameter
        If the server is bound beyond loopback without a token, or with a short one.
    """

    host: str
    token: str = ''
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if (self.token and len(self.token) < MIN_TOKEN) or (not self.token and not is_loopback(self.host)):
            raise InvalidParameter(
                f"the token of the dashboard has {len(self.token)} characters; beyond loopback (host is '{self.host}') "
                f'at least {MIN_TOKEN} are needed'
            )

    @classmethod
    def to_this_machine(cls, host: str) -> Access:
        """Return the access by all names of this machine, with the token of the environment, else one made now.

        On loopback the page needs no token, and only 'localhost' is a right name.
        """
        token = os.environ.get(TOKEN_VARIABLE, '')
        if is_loopback(host):
            return cls(host, token)
        name = socket.gethostname().lower()
        return cls(host, token or secrets.token_urlsafe(24), (host.lower(), name, f'{name}.local'))

    def url(self, port: int) -> str:
        """Return the address of the page, with its token."""
        host = socket.gethostname() if self.host in ('0.0.0.0', '::') else self.host
        host = f'[{host}]' if ':' in host else host
        return f'http://{host}:{port}/' + (f'?token={self.token}' if self.token else '')

    def knows(self, given: str) -> bool:
        """Return whether a request carries the token, compared in constant time; True if none is needed."""
        return not self.token or hmac.compare_digest(given.encode(), self.token.encode())

    def is_our_host(self, host: str) -> bool:
        """Return whether a Host header names this machine: an address, or one of its names.

        A page elsewhere that lets its name point here (DNS rebinding) comes with its own name.
        """
        name = _name(f'//{host}')
        if name in ('localhost', *self.names):
            return True
        return is_loopback(name) if is_loopback(self.host) else _is_address(name)

    def is_our_origin(self, headers: Mapping[str, str]) -> bool:
        """Return whether a request that changes something comes from this page, or from no page at all."""
        origin = headers.get('Origin')
        return origin is None or urlsplit(origin).netloc == headers.get('Host', '')


def is_loopback(host: str) -> bool:
    """Return whether an address or name can be reached from this machine alone."""
    return host == 'localhost' or (_is_address(host) and ipaddress.ip_address(host).is_loopback)


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _name(url: str) -> str:
    try:
        return (urlsplit(url).hostname or '').lower()
    except ValueError:
        return ''
