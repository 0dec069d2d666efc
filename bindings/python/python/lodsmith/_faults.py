"""Warnings and errors of the package."""

from __future__ import annotations

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
