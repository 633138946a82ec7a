"""Skips this suite, with the reason, where there is no SocketCAN."""

import socket
from pathlib import Path

import pytest


def missing():
    """Why SocketCAN cannot be tested here; None where it can."""
    try:
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as probe:
            probe.bind(("vcan0",))
    except (AttributeError, OSError) as error:
        return f"no SocketCAN with vcan0 here ({error}); run through tools/vcan, which brings it"
    return None


def pytest_collection_modifyitems(items):
    reason = missing()
    for item in items:
        if Path(__file__).parent in Path(str(item.path)).parents:
            item.add_marker(pytest.mark.socketcan)
            if reason:
                item.add_marker(pytest.mark.skip(reason=reason))
