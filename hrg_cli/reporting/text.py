"""Text from files, safe to show on a page or a terminal."""

from __future__ import annotations

import re
from typing import Any

UNREADABLE = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ufffe\uffff\ud800-\udfff]")
"""Control characters (also those that move a terminal's cursor) and those that turn the direction of text."""


def plain(value: Any) -> str:
    """Text in which unreadable characters are a replacement mark."""
    return UNREADABLE.sub("\ufffd", str(value))
