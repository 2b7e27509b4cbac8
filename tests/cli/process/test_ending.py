from __future__ import annotations

import os
import subprocess
import sys
import textwrap

import pytest

PRELUDE = """
    import os, signal, time, weakref
    import click
    from deepmuon_cli.process.ending import run

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


@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
def test_each_signal_that_asks_for_an_end_has_its_exit_code(name, code):
    assert run_command(f"signal.raise_signal(signal.{name})") == (code, "", f"it: stopped by {name}\n")


@pytest.mark.parametrize("name", ["SIGINT", "SIGHUP"])
def test_a_signal_that_is_ignored_from_the_beginning_stays_so(name):
    """As Ctrl-C in the background, and SIGHUP under nohup."""
    ignoring = (
        f"import os, signal, sys; signal.signal(signal.{name}, signal.SIG_IGN); os.execv(sys.executable, sys.argv[1:])"
    )
    program = textwrap.dedent(PRELUDE) + f"\n@click.command()\ndef command(): os.kill(os.getpid(), signal.{name})"
    done = subprocess.run(
        [sys.executable, "-c", ignoring, sys.executable, "-c", f"{program}\nrun(command, 'it')"], check=False
    )
    assert done.returncode == os.EX_OK


def test_control_characters_of_a_strangers_file_do_not_reach_the_terminal():
    body = "import warnings\nwarnings.warn('a\\n\\x1b')\nraise click.ClickException('\\x1b[2Jµ\\x9b')"
    assert run_command(body) == (2, "", "it: warning: a\\n\\x1b\nit: \\x1b[2Jµ\\x9b\n")


@pytest.mark.parametrize("environment", [{}, {"PYTHONUNBUFFERED": "1"}], ids=["buffered", "unbuffered"])
@pytest.mark.parametrize("number", [1, 100_000], ids=["little", "much"])
def test_stdout_that_can_not_be_written_is_told_in_one_line(environment, number):
    program = f"{textwrap.dedent(PRELUDE)}\n@click.command()\ndef command(): print('text' * {number})"
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-c", f"{program}\nrun(command, 'it')"],
            env=inherited | environment,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert (done.returncode, done.stderr) == (1, "it: stdout was not written to its end: No space left on device\n")


def test_other_errors_of_the_system_are_one_line():
    assert run_command("open('/missing/file')") == (
        1,
        "",
        "it: [Errno 2] No such file or directory: '/missing/file'\n",
    )


def test_stderr_that_can_not_be_written_leaves_the_exit_code():
    program = f"{textwrap.dedent(PRELUDE)}\n@click.command()\ndef command(): raise click.ClickException('no')"
    with open("/dev/full", "w") as full:
        done = subprocess.run([sys.executable, "-c", f"{program}\nrun(command, 'it')"], stderr=full, check=False)
    assert done.returncode == 2


def isolated(body: str) -> tuple[int, str]:
    """Run a command with this body as those that may meet damaged files: exit code, stderr."""
    program = f"""
        import os, signal
        import click
        from deepmuon_cli.process import isolation

        @click.command()
        def command():
            {body}

        isolation.run_isolated(command, "it")
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True, timeout=300)
    return done.returncode, done.stderr


@pytest.mark.parametrize("name", ["SIGSEGV", "SIGBUS", "SIGABRT", "SIGFPE", "SIGILL"])
def test_a_crash_is_a_damaged_file(name):
    assert isolated(f"os.kill(os.getpid(), signal.{name})") == (
        2,
        f"it: a file is damaged so that reading it was ended by {name}\n",
    )


def test_a_process_that_is_killed_from_outside_has_met_no_damaged_file():
    reason = "it: ended from outside by signal 9, Killed, as the system does when memory runs out\n"
    assert isolated("os.kill(os.getpid(), signal.SIGKILL)") == (137, reason)
    assert isolated("signal.raise_signal(signal.SIGUSR1)") == (
        138,
        "it: ended from outside by signal 10, User defined signal 1\n",
    )


def test_a_signal_after_the_commands_process_has_ended_is_late():
    """The handler that passes signals on is called when the process is waited for already."""
    program = """
        import os, signal, sys
        import click
        from deepmuon_cli.process import isolation

        @click.command()
        def command():
            pass

        wait = os.waitpid
        def wait_and_interrupt(*arguments):
            done = wait(*arguments)
            if os.getpid() == here:
                signal.raise_signal(signal.SIGINT)
            return done

        here = os.getpid()
        os.waitpid = wait_and_interrupt
        isolation.run_isolated(command, "it")
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stderr) == (0, "")
