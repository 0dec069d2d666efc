"""Progress: a function, a bar of tqdm, or ``True``."""

from __future__ import annotations

from typing import Any, Callable, Optional

Callback = Callable[[float, str], Any]


class _Bar:
    """Moves a bar of tqdm to a fraction of its total."""

    def __init__(self, bar: Any) -> None:
        self.bar = bar
        self.total = bar.total if bar.total is not None else 1.0
        if bar.total is None:
            bar.total = 1.0
        self.begin = bar.n

    def __call__(self, done: float, stage: str) -> None:
        if stage:
            self.bar.set_description(stage, refresh=False)
        step = self.begin + done * (self.total - self.begin) - self.bar.n
        if step > 0:
            self.bar.update(step)


class Reporting:
    """Context of a run: ``callback`` receives its progress; the end is reported if the run succeeds."""

    def __init__(self, progress: Any) -> None:
        self.own = None
        self.callback: Optional[Callback] = None
        if progress is None or progress is False:
            return
        if progress is True:
            try:
                from tqdm.auto import tqdm
            except ImportError as e:
                raise ImportError("progress=True needs the package tqdm; a function of (done, stage) does not") from e
            self.own = progress = tqdm(
                total=1.0, bar_format="{desc}: {percentage:3.0f}%|{bar}| {elapsed}<{remaining}", leave=False
            )
        if hasattr(progress, "update") and hasattr(progress, "total"):
            self.callback = _Bar(progress)
        elif callable(progress):
            self.callback = progress
        else:
            raise TypeError("progress: a function of (done, stage), a bar of tqdm or True is expected")

    def __enter__(self) -> "Reporting":
        return self

    def __exit__(self, kind: Any, *_: Any) -> None:
        try:
            if kind is None and self.callback is not None:
                self.callback(1.0, "done")
        finally:
            if self.own is not None:
                self.own.close()
