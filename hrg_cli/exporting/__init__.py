"""Calibration tables for other programs."""

from .c_header import Exported
from .table_files import export

__all__ = ["Exported", "export"]
