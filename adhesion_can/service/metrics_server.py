"""HTTP server of the figures: few connections at a time, each for a few seconds.

A client that opens connections and says nothing takes neither a core nor the descriptors that the
bus
needs: the oldest one is closed for the next one. Needs the extra `metrics`.
"""

import socket
import socketserver
import sys
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from prometheus_client import CollectorRegistry, MetricsHandler
from prometheus_client.registry import Collector

MOST_CONNECTIONS = 8
"""Largest number of connections that are open at a time."""
REQUEST_S = 5.0
"""Longest time for a request and its answer, s; they take milliseconds."""
LOOK_S = 0.25
"""Time between two looks for connections that are too old, and for the end, s."""
AGAIN_S = 0.1
"""Pause where no connection can be taken, as no descriptor is left, s."""


class _Handler(MetricsHandler):
    """Answer to one request, given up where the client neither sends nor takes anything."""

    timeout = REQUEST_S


class _Server(ThreadingHTTPServer):
    """A server with a bound on the number and the age of its connections."""

    daemon_threads = True
    block_on_close = False
    request_queue_size = 128

    def __init__(
        self,
        family: socket.AddressFamily,
        address: tuple[Any, ...],
        handler: type[BaseHTTPRequestHandler],
    ) -> None:
        self.address_family = family
        self._since_s: dict[Any, float] = {}
        """Time at which each open connection came, s, oldest first."""
        self._changed = threading.Condition()
        super().__init__(address, handler)

    def server_bind(self) -> None:
        """Bind, without asking the network for this host's name, which nobody uses here."""
        socketserver.TCPServer.server_bind(self)
        self.server_name, self.server_port = self.server_address[:2]  # type: ignore[assignment]

    def get_request(self) -> tuple[socket.socket, Any]:
        try:
            return super().get_request()
        except OSError:
            # It stays ready to be taken: without a pause this would be tried all the time.
            time.sleep(AGAIN_S)
            raise

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer in a thread; called by one thread alone."""
        with self._changed:
            while len(self._since_s) >= MOST_CONNECTIONS:
                _hang_up(next(iter(self._since_s)))
                self._changed.wait(AGAIN_S)
            self._since_s[request] = time.monotonic()
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        super().shutdown_request(request)
        with self._changed:
            self._since_s.pop(request, None)
            self._changed.notify()

    def service_actions(self) -> None:
        """Close what is open for too long, however slowly it goes on."""
        oldest_s = time.monotonic() - REQUEST_S
        with self._changed:
            for connection, since_s in self._since_s.items():
                if since_s < oldest_s:
                    _hang_up(connection)

    def hang_up_all(self) -> None:
        """Close all connections."""
        with self._changed:
            for connection in self._since_s:
                _hang_up(connection)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Report what failed, but for a client that has gone."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


def _hang_up(connection: socket.socket) -> None:
    """End a connection; the thread that waits for it closes it."""
    try:
        connection.shutdown(socket.SHUT_RDWR)
    except OSError:
        return  # it has ended already


class MetricsServer:
    """HTTP server that answers with figures.

    Args:
        host: Address to listen at.
        port: Port to listen at; 0 takes a free one.
        collector: Source of the figures.

    Raises:
        OSError: The address or the port cannot be had.

    """

    def __init__(self, host: str, port: int, collector: Collector) -> None:
        registry = CollectorRegistry()
        registry.register(collector)
        family, _, _, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        self._server = _Server(family, address, _Handler.factory(registry))
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(LOOK_S,), name="metrics", daemon=True
        )
        self._thread.start()
        shown = f"[{host}]" if ":" in host else host
        self.address = f"http://{shown}:{self._server.server_port}/metrics"
        """Address of the figures."""

    def close(self) -> None:
        """Stop answering."""
        self._server.shutdown()
        self._server.server_close()
        self._server.hang_up_all()
        self._thread.join()
