"""Access control of pages: this computer, or clients with the token in the address."""

import hmac
import secrets
import socket
from collections.abc import Mapping
from dataclasses import dataclass, replace
from ipaddress import ip_address
from urllib.parse import urlsplit

from pepper_drake.errors import InputError

LOOPBACK = "127.0.0.1"
"""Default address of pages, which other computers cannot reach."""

_LOOPBACK_NAMES = ("localhost", LOOPBACK, "[::1]")
_TOKEN_BYTES = 24
_LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"
"""Letters of a token that is typed, none of which looks like another."""
_HALF_LENGTH = 5
"""Number of letters in each half of such a token."""


@dataclass(frozen=True)
class Access:
    """Access control of a page.

    A browser sends requests to this computer on behalf of any website that is open in it, named in
    their header `Origin`. A website can also point a name of its own at this computer (DNS
    rebinding); then the header `Host` has that name.

    Attributes:
        host: Address at which the server listens.
        token: Secret in the page's address; None if only loopback protects the page.
    """

    host: str = LOOPBACK
    token: str | None = None

    @classmethod
    def to(cls, host: str | None) -> "Access":
        """Makes the access control for an option `--host`; loopback only for None.

        Raises:
            InputError: It is not an address of this computer.
        """
        if host is None:
            return cls()
        try:
            found = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
            family, kind, protocol, _, address = found[0]
            with socket.socket(family, kind, protocol) as probe:
                probe.bind(address)
        except (OSError, UnicodeError, IndexError):
            raise InputError(
                f'--host "{host}" is not an address of this computer; 0.0.0.0 stands for all of'
                " them"
            ) from None
        return cls(str(address[0]), secrets.token_urlsafe(_TOKEN_BYTES))

    def for_class(self) -> "Access":
        """Returns the same access with a token of its own that can be typed from a blackboard.

        Ten letters of 31 are 50 bits: at 1,000 guesses a second it lasts 13,000 years.
        """
        if self.token is None:
            return self
        halves = ("".join(secrets.choice(_LETTERS) for _ in range(_HALF_LENGTH)) for _ in range(2))
        return replace(self, token="-".join(halves))

    def url(self, port: int, path: str = "/", *, typed: bool = False) -> str:
        """Returns the address for the browser, with the token if there is one.

        Args:
            port: Port of the page.
            path: Path of the page.
            typed: Whether the token ends the path, which is shorter, and not the query.
        """
        host = self.host
        if ip_address(host).is_unspecified:
            host = _own_address() if ip_address(host).version == 4 else socket.gethostname()
        if ":" in host:
            host = f"[{host}]"
        before = f"{path}/" if typed else f"{path}?token="
        path = f"{before}{self.token}" if self.token is not None else path
        return f"http://{host}:{port}{path}"

    def refusal(
        self, headers: Mapping[str, str], token: str | None, *, public: bool = False
    ) -> str | None:
        """Returns the reason for which a request is refused, or None.

        Args:
            headers: Headers of the request.
            token: Token in its address or its cookie.
            public: Whether the requested file is the same on every computer and needs no token.
        """
        host = headers.get("Host", "").lower()
        if self.token is None:
            name = host if host.endswith("]") else host.rpartition(":")[0] or host
            if name not in _LOOPBACK_NAMES:
                return "This page is for this computer only; open it as localhost."
        elif not public and not hmac.compare_digest((token or "").encode(), self.token.encode()):
            return "Open this page by the whole address that the program printed."
        origin = headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc.lower() != host:
            return "Another website may not use this page."
        return None


def _own_address() -> str:
    """Returns the IPv4 address of this computer in its network, where few know it by its name."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # Sends nothing: it tells the way out (RFC 5737).
        except OSError:
            return socket.gethostname()
        return str(probe.getsockname()[0])
