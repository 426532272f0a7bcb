"""What can go wrong, and what is doubtful."""

from __future__ import annotations

import os
import sys
import warnings

__all__ = ["DesignError", "KfdesignError", "LogError", "LogWarning", "ParamsError"]


class KfdesignError(ValueError):
    """Something could not be done; one line says what was found, what was expected and what to do."""


class LogError(KfdesignError):
    """A log cannot be read, or nothing can be made of it."""


class ParamsError(KfdesignError):
    """Noise parameters cannot be read, or do not belong together."""


class DesignError(KfdesignError):
    """A filter cannot be read, or cannot be made."""


class LogWarning(UserWarning):
    """Something in a log or a document may make the result worth less."""


def warn(line: str) -> None:
    """Warn of the line that called this package, wherever in it the call is."""
    level, frame = 1, sys._getframe(0)
    here = os.path.dirname(os.path.abspath(__file__))
    while frame is not None and os.path.dirname(os.path.abspath(frame.f_code.co_filename)) == here:
        level, frame = level + 1, frame.f_back  # type: ignore[assignment]
    warnings.warn(line, LogWarning, stacklevel=level)
