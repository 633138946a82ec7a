"""Extensions in installed distributions, found by their entry points."""

from dataclasses import dataclass
from typing import Any

from adhesion_can.errors import PluginError

FIX = "fix or uninstall the package that provides it"


@dataclass(frozen=True, slots=True)
class Plugin:
    """An object that an installed distribution offers.

    Attributes:
        name: Name of the entry point.
        value: The object behind the entry point.
        where: Distribution and entry point, for error messages.

    """

    name: str
    value: Any
    where: str

    def error(self, what: str) -> PluginError:
        """Error of this extension.

        Args:
            what: What is wrong with it, a clause.

        """
        return PluginError(self.where, what, FIX)


def load_plugins(group: str) -> list[Plugin]:
    """Objects behind the entry points of a group, in the order of distributions and names.

    Args:
        group: Name of the group, such as 'adhesion_can.effects'.

    Raises:
        PluginError: An object cannot be imported.

    """
    from importlib.metadata import entry_points  # noqa: PLC0415 -- only who asks pays for it

    plugins = []
    for point in entry_points(group=group):
        distribution = point.dist.name if point.dist is not None else "an unknown distribution"
        where = f"{distribution}: entry point {point.name!r} of {group}"
        try:
            value = point.load()
        except Exception as error:  # the module of somebody else may raise anything
            what = f"cannot be loaded ({type(error).__name__}: {error})"
            raise PluginError(where, what, FIX) from error
        plugins.append(Plugin(point.name, value, where))
    return sorted(plugins, key=lambda plugin: plugin.where)
