"""Informative planning in the presence of outliers: a config-driven experiment runner."""

from importlib.metadata import version

__version__ = version("infoplan")
