import runpy
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.playback.run_example import make_run

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests" / "playback"))


APP = ROOT / "apps" / "play.py"
REACH = ROOT / "pepper_drake" / "models" / "demonstrations" / "reach"


@pytest.fixture(scope="module")
def two_runs(tmp_path_factory):
    root = tmp_path_factory.mktemp("runs")
    return [make_run(root / "low"), make_run(root / "high", lift=1.0, goal_rises=True)]


def play(*arguments):
    return subprocess.run(
        [sys.executable, str(APP), *map(str, arguments)], capture_output=True, text=True
    )


@pytest.fixture
def taken():
    """An address where nobody answers, and where nobody else can listen."""
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        yield f"tcp://127.0.0.1:{holder.getsockname()[1]}"


def test_two_runs_are_compared_in_a_page(run_app, two_runs, tmp_path):
    result = run_app("play", *two_runs, "--html", "both.html", "--output", tmp_path)
    assert result.returncode == 0, result.stderr
    header, *rows = result.stdout.splitlines()
    assert header.split() == ["low", "high"]
    assert ["outcome", "reached", "reached"] in [row.split() for row in rows]
    assert "both.html" in rows[-1]
    assert "MeshCat" in (tmp_path / "both.html").read_text()


def test_the_window_stays_open_from_run_to_run(two_runs):
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{probe.getsockname()[1]}"
    first = play(two_runs[0], "--zmq-url", address)
    try:
        assert first.returncode == 0, first.stderr
        window = first.stdout.split("Open ")[1].split()[0]
        second = play(REACH, "--zmq-url", address)
        assert f"Open {window} in a browser" in second.stdout, "the same window"
    finally:
        stopped = play("--stop", "--zmq-url", address)
    assert stopped.returncode == 0, stopped.stderr


SIMULATION = ("pydrake.systems.analysis", "pydrake.planning", "pepper_drake.diagrams.reaching")


def test_playing_a_run_back_needs_no_simulation(two_runs, taken):
    """And not much else either: what is not imported does not have to be waited for."""
    program = (
        "import sys, runpy\n"
        f"sys.argv = ['play.py', {str(two_runs[0])!r}, '--zmq-url', {taken!r}]\n"
        "try:\n"
        f"    runpy.run_path({str(APP)!r}, run_name='__main__')\n"
        "except SystemExit as end:\n"
        "    print(end.code, *sys.modules)\n"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    code, *modules = result.stdout.split()
    assert code == "2"
    assert "no meshcat server can be started here" in result.stderr, "all is drawn by then"
    assert "pepper_drake.playback.drawing" in modules
    assert not {*SIMULATION, "scipy", "matplotlib", "pepper_drake.learning"} & set(modules)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "no RUN to play back"),
        (("nowhere", "--html", "page.html"), "nothing to play back; give the folder of a run"),
        ((REACH, "--zmq-url", "6000"), '--zmq-url is "6000"; it must be like tcp://'),
        ((REACH, "--video", "film.avi"), "it must end in .mp4 or .gif"),
        ((REACH, "--html", "log.npz/page.html"), "page.html: cannot be written"),
        (("--stop", "--zmq-url", "TAKEN"), "there is no server to stop"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(
    tmp_path, taken, capsys, monkeypatch, arguments, message
):
    (tmp_path / "log.npz").write_text("in the way")
    texts = [taken if argument == "TAKEN" else str(argument) for argument in arguments]
    monkeypatch.setattr(sys, "argv", ["play.py", *texts, "--output", str(tmp_path)])
    with pytest.raises(SystemExit) as end:
        runpy.run_path(str(APP), run_name="__main__")
    assert end.value.code == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.startswith("error: ")
    assert output.err.count("\n") == 1
    assert message in output.err
