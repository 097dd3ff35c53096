"""The door of the page that `smc.view` opens: it lets in only those who know its address.

The address holds a secret word. Any page that is open in a browser can send requests to this
machine. So each request must begin with the secret word, name this machine as its host, and come
from no page of another origin. Others get 403 before Studio reads them. Uploads of models get 403,
too, since a model may include other files of this machine. Studio draws its panels by a second
port, whose newest connection it takes for its own: there, only this process may connect.
"""

# pyright: reportMissingImports=false
# (MuJoCo 3, which the lock has, lacks Studio)
import os
import secrets
import socket
from typing import Any

SECRET_BYTES = 16
UPLOAD = "/drop"
REFUSED = "Forbidden: open the address that smc.view prints.\n"
# The page asks for some things by paths without the secret word.
SCRIPT = """<script>{
  const [Socket, get] = [WebSocket, fetch];
  window.WebSocket = class extends Socket {
    constructor(url, ...rest) {
      super(url.replace(location.host, location.host + location.pathname.slice(0, -1)), ...rest);
    }
  };
  window.fetch = (url, ...rest) =>
    get(typeof url === "string" ? url.replace(/^[/]/, location.pathname) : url, ...rest);
}</script>"""


class InnerSocket(socket.socket):
    """A listening socket that takes the connections of this process alone."""

    def accept(self) -> tuple[socket.socket, Any]:
        """Return a connection and its address; asyncio goes on after ConnectionAbortedError."""
        connection, peer = super().accept()
        if not any(_name(int(file)) == peer for file in os.listdir("/dev/fd")):
            connection.close()
            raise ConnectionAbortedError(f"another process came from {peer}")
        return connection, peer


def _name(file: int) -> Any:
    """Return the address of an open socket of this process; None for another file."""
    try:
        opened = socket.socket(fileno=file)
    except OSError:
        return None
    try:
        return opened.getsockname()
    finally:
        opened.detach()


class Door:
    """The way to Studio's page: its methods stand for those of its server."""

    def __init__(self, server: Any):
        self.server_bind = server.bind_public_socket
        self.server_bind_inner = server.bind_loopback_socket
        self.server_serve = server.serve
        self.secret = "/" + secrets.token_urlsafe(SECRET_BYTES)
        self.bound: Any = None  # the socket
        self.hosts: tuple[str, ...] = ()  # once it is bound

    @property
    def address(self) -> str:
        """The address of the page."""
        return f"http://{self.hosts[0]}{self.secret}/"

    def bind(self, host: str, port: int) -> Any:
        """Return the socket, the same for each call, of this machine alone: Studio would serve
        the whole network.
        """
        if self.bound is None:
            self.bound = self.server_bind("127.0.0.1", port)
            port = self.bound.getsockname()[1]
            self.hosts = f"127.0.0.1:{port}", f"localhost:{port}"
        return self.bound

    def bind_inner(self, port: int = 0) -> socket.socket:
        """Return the socket to which Studio's own panels connect."""
        bound = self.server_bind_inner(port)
        if os.name == "posix":
            return InnerSocket(fileno=bound.detach())
        return bound

    def serve(self, handler: Any, *, process_request: Any, **options: Any) -> Any:
        """Serve, with refusals before all else."""

        def admit(connection: Any, request: Any) -> Any:
            path = self.inside(request.path, request.headers)
            if path is None:
                return connection.respond(403, REFUSED)
            request.path = path
            return process_request(connection, request)

        return self.server_serve(handler, process_request=admit, **options)

    def inside(self, path: str, headers: Any) -> str | None:
        """Return the path behind the secret word; None where a request is refused."""
        hosts = headers.get_all("Host")
        word = self.secret.encode()
        begins = path[: len(self.secret)].encode()
        inside = path[len(self.secret) :]
        if len(hosts) != 1 or hosts[0] not in self.hosts:
            return None
        if set(headers.get_all("Origin")) - {f"http://{hosts[0]}"}:
            return None
        if not secrets.compare_digest(begins, word) or not inside.startswith("/"):
            return None
        if inside.partition("?")[0] == UPLOAD:
            return None
        return inside
