"""The version, where every module may read it without passing the front door."""

__version__ = "0.2.0.dev0"
