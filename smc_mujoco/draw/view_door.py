"""The door of the page that `smc.view` opens: it lets in only those who know its address.

The address holds a secret word. Any page that is open in a browser can send requests to this
machine. So each request must begin with the secret word, name this machine as its host, and come
from no page of another origin. Others get 403 before viser reads them. A browser that draws without
a graphics card has less to draw.
"""

import contextlib
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from websockets.asyncio import server

SECRET_BYTES = 16
THIS_MACHINE = "127.0.0.1"
LESS_WORK = Path(__file__).with_name("view_less_work.js").read_text(encoding="utf-8")
REFUSED = "Forbidden: open the address that smc.view prints.\n"


def secret_path() -> str:
    """Return the path of a page that nobody guesses."""
    return "/" + secrets.token_urlsafe(SECRET_BYTES)


@contextlib.contextmanager
def door(secret: str) -> Iterator[None]:
    """Put servers that start in the with block behind a secret path; viser has no such option."""
    serve = server.serve

    def serve_behind(handler: Any, host: str, port: int, *, process_request: Any, **options: Any):
        def admit(connection: Any, request: Any) -> Any:
            bound = connection.local_address[1]
            path = inside(secret, bound, request.path, request.headers)
            if path is None:
                return connection.respond(403, REFUSED)
            request.path = path
            request.headers.pop("Accept-Encoding", None)
            answer = process_request(connection, request)
            if answer is not None and answer.headers.get("Content-Type", "").startswith(
                "text/html"
            ):
                answer.body = with_less_work(answer.body.decode()).encode()
                del answer.headers["Content-Length"]
                answer.headers["Content-Length"] = str(len(answer.body))
            return answer

        return serve(handler, host, port, process_request=admit, **options)

    server.serve = serve_behind
    try:
        yield
    finally:
        server.serve = serve


def with_less_work(page: str) -> str:
    """Return a page of viser that is less work where a processor draws it."""
    return page.replace("<head>", f"<head><script>{LESS_WORK}</script>", 1)


def inside(secret: str, port: int, path: str, headers: Any) -> str | None:
    """Return the path behind the secret one; None where a request to this port is refused."""
    hosts = headers.get_all("Host")
    if len(hosts) != 1 or hosts[0] not in (f"{THIS_MACHINE}:{port}", f"localhost:{port}"):
        return None
    if set(headers.get_all("Origin")) - {f"http://{hosts[0]}"}:
        return None
    begins = path[: len(secret)].encode()
    rest = path[len(secret) :]
    if not secrets.compare_digest(begins, secret.encode()) or rest[:1] not in ("", "/", "?"):
        return None
    return rest if rest.startswith("/") else "/" + rest
