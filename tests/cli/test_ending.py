from __future__ import annotations

import os
import subprocess
import sys
import textwrap

import pytest

PRELUDE = """
    import os, signal, time, weakref
    import click
    from deepmuon_cli.ending import run

    class Thing:
        pass

    class Last:
        def __del__(self):
            signal.raise_signal(signal.SIGTERM)

    def in_a_weak_references_callback():
        thing = Thing()
        reference = weakref.ref(thing, lambda _: signal.raise_signal(signal.SIGTERM))
        del thing

    def in_a_destructor():
        Last()

    def where_everything_is_caught():
        try:
            signal.raise_signal(signal.SIGTERM)
        except BaseException:
            pass

    def where_it_becomes_another_error():
        try:
            signal.raise_signal(signal.SIGTERM)
        except BaseException:
            raise ImportError("no such module")
"""


def run_command(body: str) -> tuple[int, str, str]:
    """Run a click command with this body in a process: exit code, stdout, stderr."""
    program = f"{textwrap.dedent(PRELUDE)}\n@click.command()\ndef command():\n{textwrap.indent(body, '    ')}\n"
    done = subprocess.run(
        [sys.executable, "-c", f"{program}\nrun(command, 'it')"], capture_output=True, text=True, timeout=300
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize(
    "where",
    [
        "in_a_weak_references_callback",
        "in_a_destructor",
        "where_everything_is_caught",
        "where_it_becomes_another_error",
    ],
)
def test_a_signal_that_gets_lost_comes_again(where):
    assert run_command(f"{where}()\nwhile True:\n    time.sleep(0.01)") == (143, "", "it: stopped by SIGTERM\n")


def test_a_signal_that_gets_lost_again_and_again_arrives_at_last():
    body = """
        class Sleepy:
            def __del__(self):
                time.sleep(0.1)
        in_a_destructor()
        for _ in range(5):
            Sleepy()
        while True:
            time.sleep(0.01)
    """
    assert run_command(textwrap.dedent(body)) == (143, "", "it: stopped by SIGTERM\n")


def test_a_second_signal_does_not_disturb_the_cleaning_up():
    body = """
        try:
            signal.raise_signal(signal.SIGTERM)
        finally:
            for _ in range(3):
                signal.raise_signal(signal.SIGINT)
                time.sleep(0.1)
            print("clean")
    """
    assert run_command(textwrap.dedent(body)) == (143, "clean\n", "it: stopped by SIGTERM\n")


def test_a_command_that_is_done_before_the_signal_comes_again_is_done():
    assert run_command("where_everything_is_caught()") == (0, "", "")


def test_other_errors_of_destructors_are_still_reported():
    body = "class Bad:\n    def __del__(self):\n        raise ValueError('bad')\nBad()"
    code, out, err = run_command(body)
    assert (code, out) == (0, "")
    assert "ValueError: bad" in err


def test_a_signal_that_is_ignored_from_the_beginning_stays_so():
    ignoring = (
        "import os, signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN); os.execv(sys.executable, sys.argv[1:])"
    )
    program = textwrap.dedent(PRELUDE) + "\n@click.command()\ndef command(): os.kill(os.getpid(), signal.SIGINT)"
    done = subprocess.run(
        [sys.executable, "-c", ignoring, sys.executable, "-c", f"{program}\nrun(command, 'it')"], check=False
    )
    assert done.returncode == os.EX_OK


def test_control_characters_of_a_strangers_file_do_not_reach_the_terminal():
    body = "import warnings\nwarnings.warn('a\\n\\x1b')\nraise click.ClickException('\\x1b[2Jµ\\x9b')"
    assert run_command(body) == (2, "", "it: warning: a\\n\\x1b\nit: \\x1b[2Jµ\\x9b\n")
