"""Options of commands that open a bus: python-can's own, of which the help shows the usual ones."""

import argparse
import inspect
import sys
from collections.abc import Callable
from importlib import import_module
from typing import Any, NoReturn

import can

from adhesion_can.cli.parsing import fold
from adhesion_can.errors import BusError, suggest

TITLE = "bus (python-can)"
"""Title of the group of options; which there are differs from version to version."""
_SHOWN = {
    "interface": "such as socketcan, udp_multicast, pcan, vector",
    "channel": "such as vcan0, or a multicast group",
}
"""Options that the help shows, with its text."""


class _HelpBus(argparse.Action):
    """Prints all options of the bus, as python-can explains them, and ends."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> NoReturn:
        import can.cli  # noqa: PLC0415  few commands open a bus

        plain = argparse.ArgumentParser(add_help=False, usage=argparse.SUPPRESS)
        can.cli.add_bus_arguments(plain, group_title=TITLE)
        plain.print_help(sys.stdout)
        parser.exit()


def add_bus(parser: argparse.ArgumentParser) -> None:
    """python-can's own bus options."""
    import can.cli  # noqa: PLC0415  few commands open a bus

    known = set(map(id, parser._actions))  # noqa: SLF001  argparse lists its options nowhere else
    can.cli.add_bus_arguments(parser, group_title=TITLE)
    for action in parser._actions:  # noqa: SLF001
        if id(action) in known:
            continue
        if action.dest in _SHOWN:
            action.metavar, action.help = "NAME", _SHOWN[action.dest]
        else:
            fold(action)
    group = next(section for section in parser._action_groups if section.title == TITLE)  # noqa: SLF001
    group.add_argument(
        "--help-bus",
        action=_HelpBus,
        nargs=0,
        default=argparse.SUPPRESS,
        help="show all options: bitrate, CAN FD, timing, ..",
    )


def add_wait(parser: argparse.ArgumentParser) -> None:
    """Option --wait."""
    about = "wait for a bus that does not exist yet"
    parser.add_argument("--wait", action="store_true", help=about)


def bus_opener(options: argparse.Namespace) -> Callable[[], can.BusABC]:
    """Function that opens the bus of the options.

    Raises (when called):
        BusError: there is no such bus.
    """

    def open_bus() -> can.BusABC:
        from can.cli import create_bus_from_namespace  # noqa: PLC0415  few commands open a bus

        if getattr(options, "interface", None) is None and not bus_is_configured():
            raise BusError("-i", "no interface is given", "pass for example -i socketcan -c vcan0")
        _require_known_kwargs(options)
        try:
            return create_bus_from_namespace(options)
        except argparse.ArgumentError as error:
            cause = error.__cause__ or error
            reason = " ".join(str(cause).split())[:200] or type(cause).__name__
            named = f"{getattr(options, 'interface', '?')}:{getattr(options, 'channel', '?')}"
            raise BusError(
                f"bus {named}",
                f"cannot be opened ({reason})",
                "check -i and -c; 'ip link' lists SocketCAN's channels",
            ) from error

    return open_bus


def _require_known_kwargs(options: argparse.Namespace) -> None:
    """Raise a BusError where a word of --bus-kwargs is nearly one that the interface has.

    Interfaces take whatever is given, and pass over what they do not know.
    """
    given = getattr(options, "bus_kwargs", None) or {}
    interface = getattr(options, "interface", None)
    if not given or interface not in can.interfaces.BACKENDS:
        return
    module, name = can.interfaces.BACKENDS[interface]
    try:
        known = set(inspect.signature(getattr(import_module(module), name).__init__).parameters)
    except (ImportError, AttributeError, ValueError):
        return  # opening the bus says what is missing
    for word in given:
        near = "" if word in known else suggest(word, known - {"self", "kwargs"})
        if near:
            raise BusError(f"--bus-kwargs {word}", f"{interface} has no such option", near)


def bus_is_configured() -> bool:
    """Whether python-can's files or environment variables name a bus."""
    try:
        return bool(can.util.load_config().get("interface"))
    except can.CanInterfaceNotImplementedError:
        return False
