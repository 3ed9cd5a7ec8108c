"""Calibration tables for other programs."""

from .c_header import Exported
from .tables import export

__all__ = ["Exported", "export"]
