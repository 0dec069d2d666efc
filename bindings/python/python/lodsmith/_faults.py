"""Warnings and errors of the package itself."""

from __future__ import annotations

from typing import Any


class LodsmithWarning(UserWarning):
    """Something that a result lacks: a target that was not reached, data that a format or a mesh cannot hold."""


class CommandError(ValueError):
    """Raised if a job on files fails, as the command would with the same options.

    Attributes
    ----------
    status : int
        Its exit status: 1 the file, the mesh or the system is at fault, 2 the arguments are, 3 only with ``strict``.
    report : dict or None
        What it would print with ``--json``, if the job came to its end.
    """

    def __init__(self, text: str, status: int, report: Any) -> None:
        super().__init__(text)
        self.status = status
        self.report = report
