"""Warnings and errors of the package."""

from __future__ import annotations

import sys
import warnings
from typing import Any


class LodsmithWarning(UserWarning):
    """A defect of a result: a target that was not reached, or data that a format or a mesh cannot store."""


class CommandError(ValueError):
    """Raised if a job on files fails, as the command would with the same options.

    Attributes
    ----------
    status : int
        The exit status: 1 for an error in a file, a mesh or the system, 2 for an error in the arguments, 3 only with
        ``strict``.
    report : dict or None
        The output of the command with ``--json``, if the job was completed.
    """

    def __init__(self, text: str, status: int, report: Any) -> None:
        super().__init__(text)
        self.status = status
        self.report = report


def warn(text: str) -> None:
    """Issue a warning that points to the line which called the package."""
    frame, level = sys._getframe(), 1
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "lodsmith":
        frame, level = frame.f_back, level + 1
    warnings.warn(text, LodsmithWarning, stacklevel=level)
