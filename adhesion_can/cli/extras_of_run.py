"""Options of `run` that need an extra: authenticated frames, figures for Prometheus."""

import argparse
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from typing import Any

from can.util import CAN_FD_DLC

from adhesion_can.bus.frame import Frame
from adhesion_can.errors import InputError
from adhesion_can.extras import needing_extra
from adhesion_can.service.frame_log import LogBehind
from adhesion_can.service.live import LiveService


def read_secoc(options: argparse.Namespace, sizes: Mapping[str, int]) -> Callable[[Frame], Frame]:
    """Function that secures the frames; without a key, one that leaves them as they are.

    Args:
        options: Options of the command.
        sizes: Length of each message by its name, bytes.

    Raises:
        InputError: An option or the extra is missing, a file cannot serve, or a frame has no room.

    """
    if options.secoc_key is None:
        if options.secoc_trip is not None:
            raise InputError("--secoc-trip", "no key is given", "pass --secoc-key FILE")
        return lambda frame: frame
    where = f"--secoc-key {options.secoc_key}"
    if options.secoc_trip is None:
        raise InputError(where, "no file for the trip counter is given", "pass --secoc-trip FILE")
    if not getattr(options, "fd", False):  # python-can leaves out what is not given
        raise InputError(where, "secured frames need CAN FD", "open the bus with --fd")
    with needing_extra("secoc", where, "needs cryptography"):
        from adhesion_can.bus.secoc import TRAILER_BYTES, FrameAuthenticator  # noqa: PLC0415
        from adhesion_can.service.secoc_files import TripFile, read_key  # noqa: PLC0415
    for name, size in sizes.items():
        if size + TRAILER_BYTES not in CAN_FD_DLC:
            raise InputError(
                where,
                f"{name} has {size} bytes, but CAN FD has no frame of {size + TRAILER_BYTES}",
                "give the message 4, 8, 16, 32 or 48 bytes",
            )
    trips = TripFile(options.secoc_trip)
    return FrameAuthenticator(read_key(options.secoc_key), trips.next_trip).secure


def listening_address(text: str) -> tuple[str, int]:
    """Host and port of [HOST:]PORT."""
    host, _, port = text.rpartition(":")
    if not (port.isascii() and port.isdecimal() and int(port) < 1 << 16):
        raise argparse.ArgumentTypeError(
            f"{text!r} is neither a port from 0 to 65535 nor HOST:PORT"
        )
    return host.strip("[]") or "127.0.0.1", int(port)


def serve_metrics(
    stack: ExitStack,
    listen_at: tuple[str, int],
    service: LiveService,
    log: LogBehind | None,
    more: Callable[[], Iterable[Any]] | None = None,
) -> str:
    """Answer Prometheus until the stack is closed; returns the address.

    Args:
        stack: What ends with the service.
        listen_at: Host and port.
        service: Service whose figures are served.
        log: Its log; None: there is none.
        more: Figures of what runs beside the service; None: there are none.

    Raises:
        InputError: The extra is not installed, or the port cannot be had.

    """
    host, port = listen_at
    where = f"--metrics {host}:{port}"
    with needing_extra("metrics", where, "needs prometheus-client"):
        from adhesion_can.service.metrics import ServiceCollector  # noqa: PLC0415
        from adhesion_can.service.metrics_server import MetricsServer  # noqa: PLC0415
    lost = (lambda: 0) if log is None else (lambda: log.lost)
    try:
        server = MetricsServer(host, port, ServiceCollector(service, lost, more or (lambda: ())))
    except OSError as error:
        raise InputError(where, error.strerror or str(error), "name another port") from error
    stack.callback(server.close)
    return server.address
