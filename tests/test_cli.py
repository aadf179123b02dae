import subprocess
import sys
import time
from pathlib import Path

import pytest

from pepper_drake import cli
from pepper_drake.errors import InputError, PepperDrakeError, StoppedError


@pytest.mark.parametrize("argument", ["-1", "x", "1.5", ""])
def test_what_is_no_seed_is_one_line_and_exit_code_2(argument, capsys):
    with pytest.raises(SystemExit) as exit_info:
        cli.make_parser("app", "What it does.").parse_args([f"--seed={argument}"])
    assert exit_info.value.code == cli.EXIT_BAD_INPUT
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert error.startswith("error: argument --seed: ")
    assert "whole number" in error


def test_apps_are_named_as_they_are_run(monkeypatch):
    text = (
        "see reach.py --help and apps/play.py: own.py:Mine, examples/robot.py, FILE.py:NAME, "
        "own.py: no such file; own_cost.py defines no x"
    )
    assert cli.as_run(text) == text
    monkeypatch.setattr(sys, "argv", ["pepper-drake learn"])
    expected = text.replace("reach.py", "pepper-drake reach").replace(
        "apps/play.py", "pepper-drake play"
    )
    assert cli.as_run(text) == expected


def test_an_unknown_option_is_one_line_that_points_to_the_help(capsys):
    with pytest.raises(SystemExit) as exit_info:
        cli.make_parser("app", "What it does.").parse_args(["--sede", "1"])
    assert exit_info.value.code == cli.EXIT_BAD_INPUT
    assert capsys.readouterr().err == "error: unrecognized arguments: --sede 1; see app.py --help\n"


def test_an_output_folder_without_a_name_is_not_the_present_one(capsys):
    with pytest.raises(SystemExit):
        cli.make_parser("app", "What it does.").parse_args(["--output", ""])
    assert "argument --output: it is empty; give a folder" in capsys.readouterr().err


def test_every_app_has_an_output_folder_a_seed_and_quiet():
    options = cli.make_parser("app", "What it does.").parse_args([])
    assert options.output.parts == ("out", "app")
    assert (options.seed, options.quiet) == (0, False)


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (InputError("mend this"), cli.EXIT_BAD_INPUT, "error: mend this\n"),
        (PepperDrakeError("it broke"), cli.EXIT_FAILED, "error: it broke\n"),
        (StoppedError("nothing was kept"), 130, "interrupted: nothing was kept\n"),
        (KeyboardInterrupt(), 130, "interrupted\n"),
        (
            PermissionError(13, "Permission denied", "a\nb"),
            cli.EXIT_BAD_INPUT,
            "error: a\\nb: Permission denied\n",
        ),
    ],
)
def test_errors_become_a_line_and_a_code(error, code, line, capsys):
    def main():
        raise error

    with pytest.raises(SystemExit) as exit_info:
        cli.run(main)
    assert exit_info.value.code == code
    assert capsys.readouterr().err == line


def test_an_import_is_not_interrupted_but_what_comes_after_it(tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "half_a_library.py").write_text(
        "import signal\nsignal.raise_signal(signal.SIGTERM)\nwhole = True\n"
    )
    seen = []

    def main():
        import half_a_library

        seen.append(half_a_library.whole)
        time.sleep(10.0)

    with pytest.raises(SystemExit) as exit_info:
        cli.run(main)
    assert exit_info.value.code == 130
    assert capsys.readouterr().err == "interrupted\n"
    assert seen == [True]


def test_a_fault_of_our_own_is_not_hidden():
    def main():
        raise RuntimeError("a bug")

    with pytest.raises(RuntimeError, match="a bug"):
        cli.run(main)


def test_after_a_kill_the_shared_memory_goes_without_a_word():
    code = """
import os, signal
from multiprocessing import shared_memory
from pepper_drake import cli

def main():
    print(shared_memory.SharedMemory(create=True, size=1).name, flush=True)
    os.kill(os.getpid(), signal.SIGKILL)

cli.run(main)
"""
    # Its pipes end when the last process of it has ended.
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert ran.returncode == -9
    assert ran.stderr == ""
    assert not (Path("/dev/shm") / ran.stdout.strip().lstrip("/")).exists()


def run_in_shell(body, redirection="", encoding="utf-8"):
    code = f"from pepper_drake import cli\ndef main():\n    {body}\n    return 0\ncli.run(main)\n"
    return subprocess.run(
        ["bash", "-c", f'"$0" -c "$1" {redirection}', sys.executable, code],
        capture_output=True,
        timeout=60,
        env={
            "PATH": "/usr/bin:/bin",
            "PYTHONPATH": ":".join(sys.path),
            "PYTHONIOENCODING": encoding,
        },
    )


def test_output_to_a_full_disk_is_one_line():
    for body in ("print(1)", "print('x' * 100000)", "cli.quiet_libraries(); print(1)"):
        ran = run_in_shell(body, ">/dev/full")
        assert ran.returncode == cli.EXIT_BAD_INPUT
        assert ran.stderr.decode() == (
            "error: what is printed cannot be written (No space left on device)\n"
        )


def test_closed_streams_keep_files_from_their_places():
    body = "cli.quiet_libraries(); print(1); assert open('/dev/null').fileno() > 2"
    for redirection in (">&-", "<&- >&-", "<&- >&- 2>&-"):
        ran = run_in_shell(body, redirection)
        assert (ran.returncode, ran.stdout, ran.stderr) == (0, b"", b"")


def test_a_name_without_characters_in_the_terminal_is_printed_by_its_codes():
    for body in ("print('a \\u2013 b')", "cli.quiet_libraries(); print('a \\u2013 b')"):
        ran = run_in_shell(body, encoding="latin-1")
        assert (ran.returncode, ran.stdout) == (0, b"a \\u2013 b\n")


def test_an_interrupt_while_an_app_imports_is_one_line():
    # A shell has what it starts in the background ignore the signal.
    code = (
        "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from pepper_drake import cli\nsignal.raise_signal(signal.SIGINT)\n"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert ran.stderr == "interrupted\n"
    assert ran.returncode != 0
