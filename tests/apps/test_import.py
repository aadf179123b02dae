import json
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.dmp.joint_primitive import JointPrimitive
from pepper_drake.learning.dmp.rhythmic import RhythmicPrimitive
from tests.learning.demonstrations.importers.recordings import (
    NAMES,
    make_motion,
    table,
    write,
    write_motive,
)
from tests.printed import missing, shown_lines

APPS = Path(__file__).resolve().parents[2] / "apps"


def run_app(monkeypatch, name, *arguments):
    """Returns the app's exit code."""
    monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        runpy.run_path(str(APPS / name), run_name="__main__")
    return stopped.value.code


@pytest.fixture(scope="module")
def motion():
    return make_motion()


def test_import_writes_what_the_other_apps_read(monkeypatch, tmp_path, capsys, motion):
    take = write_motive(tmp_path, motion)
    joints = write(
        tmp_path / "log.csv",
        table(motion.times, np.degrees(motion.joints), header=",".join(["time", *NAMES])),
    )
    code = run_app(
        monkeypatch, "import.py", take, joints, "--angle", "deg", "--output", tmp_path / "out"
    )
    assert code == 0
    said = capsys.readouterr().out
    assert "OptiTrack Motive" in said
    assert "lengths in mm" in said
    assert "100 % within the arm's reach" in said
    for name in ("motive", "log"):
        folder = tmp_path / "out" / name
        back = Demonstration.load(folder)
        np.testing.assert_allclose(back.positions, motion.positions, atol=1e-6)
        report = json.loads((folder / "check.json").read_text())
        assert report["samples"] == len(motion.times)
        assert report["warnings"] == []
        assert (folder / "check.png").stat().st_size > 10_000


def test_import_tells_what_is_doubtful_and_refuses_what_cannot_be(
    monkeypatch, tmp_path, capsys, motion
):
    kept = (motion.times < 0.6) | (motion.times > 1.1)
    gap = write(
        tmp_path / "gap.csv",
        table(motion.times[kept], motion.positions[kept], header="time,x,y,z"),
    )
    assert run_app(monkeypatch, "import.py", gap, "--output", tmp_path / "out") == 0
    assert "warning: sample 31: a gap of" in capsys.readouterr().out
    large = write(
        tmp_path / "large.csv", table(motion.times, 1e3 * motion.positions, header="time,x,y,z")
    )
    assert run_app(monkeypatch, "import.py", large, "--output", tmp_path / "no") == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: {large}, line ")
    assert "--unit mm" in error
    assert error.count("\n") == 1
    assert not (tmp_path / "no").exists()


def test_names_in_files_lead_nowhere_else(monkeypatch, tmp_path, motion):
    header = "time,../../one_x,../../one_y,../../one_z,two_x,two_y,two_z"
    text = table(motion.times, motion.positions, motion.positions, header=header)
    path = write(tmp_path / "take.csv", text)
    assert run_app(monkeypatch, "import.py", path, "--output", tmp_path / "out", "--quiet") == 0
    assert len(list((tmp_path / "out").iterdir())) == 2


def test_learn_periodic_motions(monkeypatch, tmp_path, motion):
    times = np.arange(0.0, 5.0, 0.02)
    phase = 2 * np.pi * times / 1.25
    waves = np.column_stack((np.sin(phase), np.cos(phase), np.sin(2 * phase)))
    path = write(
        tmp_path / "wave.csv",
        table(times, [0.2, -0.2, 0.0] + 0.05 * waves, header="time,x,y,z"),
    )
    arguments = (path, "--rhythmic", "--output", tmp_path / "out", "--quiet")
    assert run_app(monkeypatch, "learn.py", *arguments) == 0
    primitive = RhythmicPrimitive.load(tmp_path / "out" / "rhythmic.yaml")
    assert primitive.period == pytest.approx(1.25, abs=1e-3)


def test_learn_and_perform_joints(monkeypatch, tmp_path, motion):
    path = write(
        tmp_path / "two.csv",
        table(motion.times, motion.joints[:, [0, 3]], header=f"time,{NAMES[0]},{NAMES[3]}"),
    )
    arguments = (path, "--joints", "--output", tmp_path / "out", "--quiet")
    assert run_app(monkeypatch, "learn.py", *arguments) == 0
    file = tmp_path / "out" / "joints.yaml"
    assert JointPrimitive.load(file).names == (NAMES[0], NAMES[3])
    arguments = ("--primitive", file, "--output", tmp_path / "done", "--quiet")
    assert run_app(monkeypatch, "reproduce.py", *arguments) == 0


def test_learn_a_motion_through_a_via_point(monkeypatch, tmp_path, capsys, motion):
    folders = []
    for k in range(3):
        bent = motion.positions + 0.02 * k * np.sin(np.pi * motion.times / 2.0)[:, None]
        folders.append(tmp_path / f"shown{k}")
        Demonstration.from_positions(motion.times, bent).save(folders[-1])
    middle = motion.positions[len(motion.times) // 2] + [0.03, 0.03, 0.03]
    arguments = (*folders, "--via", 0.5, *middle, "--output", tmp_path / "out", "--quiet")
    assert run_app(monkeypatch, "learn.py", *arguments) == 0
    path = MovementPrimitive.load(tmp_path / "out" / "primitive.yaml").rollout()
    assert np.linalg.norm(path.positions - middle, axis=1).min() < 2e-3
    assert run_app(monkeypatch, "learn.py", folders[0], "--via", 0.5, *middle) == 2
    assert "at least two" in capsys.readouterr().err


def test_chain_joins_without_a_jump_and_is_performed(monkeypatch, tmp_path, motion):
    motion.save(tmp_path / "reach")
    back = ",".join(map(str, motion.positions[0]))
    movements = (f"{tmp_path / 'reach'}!", f"{tmp_path / 'reach'}@{back}", "wait:0.3")
    via = ("--via", 2, 0.5, 0.2, -0.25, 0.0)
    out = tmp_path / "out"
    arguments = (*movements, *via, "--perform", "--output", out, "--quiet")
    assert run_app(monkeypatch, "chain.py", *arguments) == 0
    report = json.loads((out / "report.json").read_text())
    assert report["outcome"] == "reached"
    assert report["largest_velocity_jump"] < 1e-3
    chain = Demonstration.load(out / "chain")
    assert chain.duration == pytest.approx(2 * motion.duration + 0.3, abs=0.02)
    assert np.linalg.norm(chain.positions - [0.2, -0.25, 0.0], axis=1).min() < 2e-3
    np.testing.assert_allclose(chain.positions[-1], motion.positions[0], atol=1e-6)


def test_what_the_pages_show_is_printed(monkeypatch, tmp_path, capsys):
    """The page's recording: a quarter of a metre with least jerk."""
    monkeypatch.chdir(tmp_path)
    shown = Path(__file__).parents[2] / "docs" / "howto" / "recordings.md"
    times = 10 * np.arange(201)
    s = (times / times[-1])[:, None]
    path = [100.0, -200.0, 0.0] + (s**3 * (10 - 15 * s + 6 * s**2)) * [200.0, 150.0, 0.0]
    rows = [";".join([f"{t}", *(f"{x:.2f}" for x in p)]) for t, p in zip(times, path, strict=True)]
    take = "\n".join(["time [ms];x [mm];y [mm];z [mm]", *rows, ""])
    assert f"```text\n{chr(10).join(take.splitlines()[:3])}\n```" in shown.read_text()
    write(tmp_path / "take.csv", take)
    assert run_app(monkeypatch, "import.py", "take.csv") == 0
    imported = [line for line in shown_lines("docs/howto/recordings.md") if ";" not in line]
    assert missing(imported, capsys.readouterr().out) == []
    words = ("out/import/take!", "wait:1", "out/import/take@0.2,-0.2,0.1")
    assert run_app(monkeypatch, "chain.py", *words) == 0
    chained = [line.partition("; jump")[0] for line in shown_lines("docs/howto/chains.md")]
    said = capsys.readouterr().out
    assert missing(chained, said.replace("; jump", "\n")) == [], said


@pytest.mark.parametrize(
    ("movements", "words"),
    [
        (("wait:1",), "nothing but waiting"),
        (("wait:x",), "'x' is not a number"),
        (("nothing.yaml",), "no such file"),
        (("SHOWN@1,2",), "must be 3 finite numbers"),
        (("SHOWN@300,-200,100",), "374 m from the torso, and the arm reaches 0.41 m; give metres"),
        (("SHOWN", "--via", 1, 0.5, 300, 0, 0), "--via: 300 m from the torso"),
        (("SHOWN", "--move", 1, 0.5, 300, 0, 0), "--move: 300 m from the torso"),
        (("SHOWN", "--start", 300, 0, 0), "--start: 300 m from the torso"),
        (("SHOWN", "--via", 3, 0.5, 0, 0, 0), "--via 3: there are 1 movements"),
        (("SHOWN", "--move", 1, 99, 0, 0, 0), "movement 1 ends at"),
        (("SHOWN", "--blend", 0), "blend: 0.0 is not"),
    ],
)
def test_chain_refuses_in_one_line(monkeypatch, tmp_path, capsys, motion, movements, words):
    motion.save(tmp_path / "shown")
    given = [str(m).replace("SHOWN", str(tmp_path / "shown")) for m in movements]
    assert run_app(monkeypatch, "chain.py", *given, "--output", tmp_path / "out") == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1


def test_play_exports(monkeypatch, tmp_path, capsys, motion):
    motion.save(tmp_path / "reach")
    arguments = (tmp_path / "reach", "--export", "tum", "--output", tmp_path)
    assert run_app(monkeypatch, "play.py", *arguments) == 0
    assert "reach.tum" in capsys.readouterr().out
    back = Demonstration.load(tmp_path / "reach.tum")
    np.testing.assert_allclose(back.positions, motion.positions, atol=1e-6)
