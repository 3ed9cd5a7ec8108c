"""Studies and the catalogue of effects."""

from __future__ import annotations

from typing import Any

from .shape import Common, Shape


class Study(Common):
    """`hrg study`."""

    name: str
    """The study."""
    settings: dict[str, Any]
    """Its settings."""
    result: dict[str, Any]
    """Its figures."""


class EffectInList(Shape):
    """An effect of the catalogue."""

    name: str
    """The effect."""
    family: str
    """Its family."""
    parameters: list[str]
    """Its parameters."""
    title: str
    """In words."""


class Effects(Common):
    """`hrg effects`, or `hrg effects NAME`."""

    effects: list[EffectInList] | None = None
    """The catalogue, without NAME."""
    name: str | None = None
    """The effect."""
    page: str | None = None
    """Its page."""
