import pytest

from pepper_drake.errors import InputError
from pepper_drake.models.obj_files import check_obj
from pepper_drake.models.shapes import MESHES_DIR

CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
FACES = "f 1 2 4 3\nf 5 6 8 7\nf 1 2 6 5\nf 3 4 8 7\nf 1 3 7 5\nf 2 4 8 6\n"


@pytest.fixture
def check(tmp_path):
    def write(text, name="cube.obj"):
        path = tmp_path / name
        path.write_text(text)
        check_obj(path)

    return write


def test_shipped_meshes_are_solids():
    for path in MESHES_DIR.glob("*.obj"):
        check_obj(path)


@pytest.mark.parametrize(
    "faces", [FACES, FACES.replace("f 2 4 8 6", "f -7 -5 -1 -3"), FACES + "s off\ng side\n"]
)
def test_a_cube_is_a_solid(check, faces):
    check("# a cube\n" + CUBE + faces)
    check(
        CUBE
        + "vt 0 0\nvn 0 0 1\n"
        + "".join(
            "f " + " ".join(f"{word}/1/1" for word in line.split()[1:]) + "\n"
            for line in FACES.splitlines()
        )
    )


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (CUBE + FACES + "f 1 2 9", "line 15: there is no v number 9; there are 8"),
        (CUBE + FACES + "f 1 2 0", "there is no v number 0"),
        (CUBE + FACES + "f 1 2 -9", "there is no v number -9"),
        (CUBE + FACES + "f 1 2 99999999999999999999", "there is no v number"),
        (CUBE + FACES + "f 1 2 \x1e3", "control characters"),
        (CUBE + FACES + "f 1 2 x", "there is no v number x"),
        (CUBE + FACES + "f 1/1 2/1 3/1", "there is no vt number 1; there are 0"),
        (CUBE + FACES + "f 1 2", "a face has 3 to 64 corners"),
        (CUBE + FACES + "f 1 2 2", "the corners of a face must differ"),
        (CUBE + FACES + "f 1/2/3/4 2 3", "is not a corner"),
        (CUBE + FACES + "v 1 2", "line 15: v needs 3 numbers"),
        (CUBE + FACES + "v 1 nan 2", "v needs 3 numbers"),
        (CUBE + FACES + "v 1 1e30 2", "of at most 10000"),
        (CUBE + FACES + "curv 0 1 1 2", "curv is not read"),
        (CUBE, "0 faces and 8 vertices enclose no solid"),
        (CUBE.replace(" 1\n", " 0\n") + FACES, "the mesh is flat"),
        ("v 1 1 1\n" * 8 + FACES, "the mesh is flat"),
        (CUBE + FACES + "mtllib ../../secret.mtl", "leads out of its folder"),
        (CUBE + FACES + "mtllib /etc/passwd", "leads out of its folder"),
        (CUBE + FACES + "mtllib none.mtl", "none.mtl: no such file"),
        ("\0" + CUBE, "not a text file"),
    ],
)
def test_what_is_no_solid_is_refused_with_its_line(check, text, sentence):
    with pytest.raises(InputError, match=r"cube\.obj") as refusal:
        check(text)
    assert sentence in str(refusal.value)


def test_materials_and_textures_stay_in_the_folder(tmp_path, check):
    (tmp_path / "cube.mtl").write_text("newmtl a\nKd 1 0 0\nmap_Kd wood.png\n")
    with pytest.raises(InputError, match=r"wood\.png: no such file"):
        check(CUBE + FACES + "mtllib cube.mtl\n")
    (tmp_path / "wood.png").symlink_to("/dev/zero")
    with pytest.raises(InputError, match=r"leads out of its folder"):
        check(CUBE + FACES + "mtllib cube.mtl\n# again")
    (tmp_path / "wood.png").unlink()
    (tmp_path / "wood.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    check(CUBE + FACES + "mtllib cube.mtl\n# once more")
