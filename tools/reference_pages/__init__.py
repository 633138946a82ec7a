"""Pages of docs/reference that are made of the code: settings, messages, commands."""

from reference_pages.commands import commands_page
from reference_pages.fleet import fleet_page
from reference_pages.messages import messages_page
from reference_pages.settings import configuration_page

PAGES = {
    "configuration.md": configuration_page,
    "messages.md": messages_page,
    "commands.md": commands_page,
    "fleet.md": fleet_page,
}
"""Maker of each page, by its file in docs/reference."""
