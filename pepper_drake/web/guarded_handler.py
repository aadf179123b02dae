"""Access control of requests, before anything else of them is read."""

import hashlib

import tornado.web

from pepper_drake.web.access import Access


class GuardedHandler(tornado.web.RequestHandler):
    """Answers only requests that the access admits; also a base of websockets."""

    _access = Access()
    _public = False

    def guard(self, access: Access, *, public: bool) -> None:
        """Sets the access control; call it in `initialize`.

        Args:
            access: The admitted clients.
            public: See `Access.refusal`.
        """
        self._access, self._public = access, public

    def prepare(self) -> None:
        """Ends a refused request, before anything else of it is read."""
        try:
            refusal = self._refusal()
        except ValueError:  # A malformed Origin.
            refusal = "This request makes no sense."
        if refusal is not None:
            self.set_status(403)
            self.finish(refusal + "\n")

    def _refusal(self) -> str | None:
        # Pages of one computer share their cookies, regardless of their ports.
        name = "token_" + hashlib.sha256((self._access.token or "").encode()).hexdigest()[:12]
        in_address = self.path_kwargs.get("token") or self.get_query_argument("token", None)
        refusal = self._access.refusal(
            self.request.headers, in_address or self.get_cookie(name), public=self._public
        )
        if refusal is None and in_address and not self._public:
            # Requests for the page's own files do not carry the token in their address.
            self.set_cookie(name, in_address, httponly=True, samesite="Strict")
        return refusal

    def set_default_headers(self) -> None:
        """Forbids other websites to show this one in a frame, against clickjacking."""
        self.set_header("Content-Security-Policy", "frame-ancestors 'self'")
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cache-Control", "no-store")

    def write_error(self, status_code: int, **kwargs: object) -> None:
        """Answers with the status code only."""
        self.finish(f"{status_code}\n")
