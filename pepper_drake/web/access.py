"""Who may open a page: this computer, or whoever knows the token in the address."""

import hmac
import secrets
import socket
from collections.abc import Mapping
from dataclasses import dataclass
from ipaddress import ip_address
from urllib.parse import urlsplit

from pepper_drake.errors import InputError

LOOPBACK = "127.0.0.1"
"""Default address of pages: nothing outside this computer reaches it."""

_LOOPBACK_NAMES = ("localhost", LOOPBACK, "[::1]")
_TOKEN_BYTES = 24


@dataclass(frozen=True)
class Access:
    """Who may open a page.

    A browser sends requests to this computer for any website that is open in it, and says so in
    their header `Origin`. It also does so under a name that the website chose and lets point at
    this computer (DNS rebinding); then the header `Host` has that name.

    Attributes:
        host: Address that the server listens at.
        token: Secret in the page's address; None where loopback alone protects.
    """

    host: str = LOOPBACK
    token: str | None = None

    @classmethod
    def to(cls, host: str | None) -> "Access":
        """Makes the access for an option `--host`: loopback only if it was not given.

        Raises:
            InputError: There is no such address on this computer.
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

    def url(self, port: int, path: str = "/") -> str:
        """Returns the address for the browser, with the token if there is one."""
        host = self.host
        if ip_address(host).is_unspecified:
            host = _own_address() if ip_address(host).version == 4 else socket.gethostname()
        if ":" in host:
            host = f"[{host}]"
        query = f"?token={self.token}" if self.token is not None else ""
        return f"http://{host}:{port}{path}{query}"

    def refusal(
        self, headers: Mapping[str, str], token: str | None, *, public: bool = False
    ) -> str | None:
        """Returns why a request is refused, or None.

        Args:
            headers: The request's.
            token: What it has for a token, in its address or its cookie.
            public: Whether what is asked for is the same on every computer, so that no token is
                needed to see it.
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
