"""Configuration: everything that a user can set, and its files."""

from adhesion_can.config.configuration import UNKNOWN_CYCLE, Configuration, ServiceSettings
from adhesion_can.config.load import load_configuration

__all__ = ["UNKNOWN_CYCLE", "Configuration", "ServiceSettings", "load_configuration"]
