"""Skips this suite, with the reason, where there is no SocketCAN."""

import os
import shutil
import socket
import sys
from pathlib import Path

import pytest

if "ADHESION_CAN_EMULATED" in os.environ:
    # python-can imports asammdf where it is installed, and that pandas: a fifth of all imports, in
    # which an emulated machine spends most of its time. No MF4 file is read here.
    sys.modules["asammdf"] = None


def missing():
    """Why SocketCAN cannot be tested here; None where it can."""
    try:
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as probe:
            probe.bind(("vcan0",))
    except (AttributeError, OSError) as error:
        return f"no SocketCAN with vcan0 here ({error}); run through tools/vcan, which brings it"
    absent = [tool for tool in ("candump", "canplayer", "ip") if not shutil.which(tool)]
    return f"not installed: {', '.join(absent)} (can-utils, iproute2)" if absent else None


def pytest_collection_modifyitems(items):
    reason = missing()
    for item in items:
        if Path(__file__).parent in Path(str(item.path)).parents:
            item.add_marker(pytest.mark.socketcan)
            if reason:
                item.add_marker(pytest.mark.skip(reason=reason))
