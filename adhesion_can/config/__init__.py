"""Configuration: between the rooms that it sets up and those that use it."""

from adhesion_can.config.configuration import Configuration, ServiceSettings
from adhesion_can.config.load import load_configuration

__all__ = ["Configuration", "ServiceSettings", "load_configuration"]
