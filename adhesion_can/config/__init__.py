"""Configuration: between the rooms that it sets up and those that use it."""

from adhesion_can.config.file import load_configuration
from adhesion_can.config.model import Configuration, ServiceSettings

__all__ = ["Configuration", "ServiceSettings", "load_configuration"]
