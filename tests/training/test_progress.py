from __future__ import annotations

import pytest
from support.terminal import terminal
from tqdm import tqdm

from deepmuon_training.progress import progress_bar


class Clock:
    """Time that passes only when it is told to."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


def steps(number: int, seconds: float, hidden: bool = False) -> None:
    """Run a computation whose steps take so long."""
    clock = Clock()
    with progress_bar(number, "learning", " steps", hidden=hidden) as bar:
        bar._time, bar.start_t, bar.last_print_t = clock, clock.now, clock.now
        for _ in range(number):
            clock.now += seconds
            bar.update()


def test_a_log_gets_a_line_every_half_minute(capsys):
    steps(3000, 0.1)
    written = capsys.readouterr().err
    lines = written.splitlines()
    assert 9 <= len(lines) <= 11  # of 300 s
    assert all("learning" in line and "/3000" in line for line in lines)
    assert "\r" not in written


@pytest.mark.parametrize(("seconds", "hidden"), [(0.001, False), (1.0, True)], ids=["short", "hidden"])
def test_what_is_short_or_hidden_leaves_no_line(capsys, seconds, hidden):
    steps(1000, seconds, hidden)
    assert capsys.readouterr().err == ""


def test_a_terminal_gets_a_bar_that_is_written_over(monkeypatch):
    shown = terminal(monkeypatch)
    with progress_bar(10, "learning", " steps", hidden=False) as bar:
        bar.update(10)
    assert "\r" in shown.getvalue()
    assert isinstance(bar, tqdm)
