"""The range of a setting, beside its type: ``steps: Annotated[int, Range(1, 1e8)]``."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, get_type_hints

from deepmuon_runtime.errors import RefusedError

__all__ = ["Range", "check_ranges"]


@dataclass(frozen=True)
class Range:
    """Between which numbers a setting may lie.

    Parameters
    ----------
    low, high
        Its ends.
    above, below
        Whether low and high themselves are out of it.
    """

    low: float
    high: float
    above: bool = False
    below: bool = False

    def __contains__(self, value: float) -> bool:
        """Tell whether a number lies in it; NaN does not."""
        return (self.low < value if self.above else self.low <= value) and (
            value < self.high if self.below else value <= self.high
        )

    def __str__(self) -> str:
        """Say it in words that follow "should be"."""
        low, high = _number(self.low), _number(self.high)
        if self.above or self.below:
            return f"{'above' if self.above else 'at least'} {low} and {'below' if self.below else 'at most'} {high}"
        return f"from {low} to {high}"


def _number(value: float) -> str:
    return f"{value:,}" if isinstance(value, int) else f"{value:g}"


def check_ranges(settings: Any) -> None:
    """Refuse a dataclass of settings with a value out of the range of its field; None is in any.

    Raises
    ------
    RefusedError
        That names the field, its value and the range.
    """
    hints = get_type_hints(type(settings), include_extras=True)
    for field in fields(settings):
        value = getattr(settings, field.name)
        for allowed in getattr(hints[field.name], "__metadata__", ()):
            if isinstance(allowed, Range) and value is not None and value not in allowed:
                raise RefusedError(f"{field.name} is {value}, and should be {allowed}")
