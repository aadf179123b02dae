"""Requests, refused before anything of them is looked at."""

import hashlib

import tornado.web

from pepper_drake.web.access import Access


class GuardedHandler(tornado.web.RequestHandler):
    """Answers only requests that the access admits; also a base of websockets."""

    _access = Access()
    _public = False

    def guard(self, access: Access, *, public: bool) -> None:
        """Sets who may ask; call it in `initialize`.

        Args:
            access: Who may ask.
            public: See `Access.refusal`.
        """
        self._access, self._public = access, public

    def prepare(self) -> None:
        """Ends a request that is refused, before anything of it is looked at."""
        try:
            refusal = self._refusal()
        except ValueError:  # An Origin that is no address at all.
            refusal = "This request makes no sense."
        if refusal is not None:
            self.set_status(403)
            self.finish(refusal + "\n")

    def _refusal(self) -> str | None:
        # Pages of one computer share their cookies, whatever their ports.
        name = "token_" + hashlib.sha256((self._access.token or "").encode()).hexdigest()[:12]
        in_address = self.get_query_argument("token", None)
        refusal = self._access.refusal(
            self.request.headers, in_address or self.get_cookie(name), public=self._public
        )
        if refusal is None and in_address and not self._public:
            # What the page loads by itself comes without its address.
            self.set_cookie(name, in_address, httponly=True, samesite="Strict")
        return refusal

    def set_default_headers(self) -> None:
        """Lets no other website show this one in a frame, where clicks could be led astray."""
        self.set_header("Content-Security-Policy", "frame-ancestors 'self'")
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cache-Control", "no-store")

    def write_error(self, status_code: int, **kwargs: object) -> None:
        """Answers what went wrong in one word, and no more."""
        self.finish(f"{status_code}\n")
