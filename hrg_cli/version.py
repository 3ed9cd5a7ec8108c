"""The version, once: what files, pages and `--version` say."""

__version__ = "0.1.0"
