import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.perception.mapping.cloud_files import load_cloud

POINTS = np.random.default_rng(1).uniform(-1, 1, (50, 3)).astype(np.float32)
WITH_NAN = np.vstack([POINTS, [[np.nan, 0, 0]]]).astype(np.float32)


def pcd(path, data="ascii"):
    pypcd4 = pytest.importorskip("pypcd4", reason="reads PCD files")
    encoding = {
        "ascii": pypcd4.Encoding.ASCII,
        "binary": pypcd4.Encoding.BINARY,
        "compressed": pypcd4.Encoding.BINARY_COMPRESSED,
    }[data]
    pypcd4.PointCloud.from_xyz_points(WITH_NAN).save(path, encoding=encoding)


def ply(path, text=True):
    plyfile = pytest.importorskip("plyfile", reason="reads PLY files")
    vertices = np.zeros(len(WITH_NAN), [("red", "u1"), ("x", "f4"), ("z", "f4"), ("y", "f4")])
    for k, name in enumerate("xyz"):
        vertices[name] = WITH_NAN[:, k]
    element = plyfile.PlyElement.describe(vertices, "vertex")
    plyfile.PlyData([element], text=text).write(path)


@pytest.mark.parametrize("data", ["ascii", "binary", "compressed"])
def test_pcd_files_are_read(tmp_path, data):
    pcd(tmp_path / "c.pcd", data)
    np.testing.assert_allclose(load_cloud(tmp_path / "c.pcd"), POINTS, atol=1e-6)


@pytest.mark.parametrize("text", [True, False])
def test_ply_files_are_read(tmp_path, text):
    ply(tmp_path / "c.ply", text)
    np.testing.assert_allclose(load_cloud(tmp_path / "c.ply"), POINTS, atol=1e-6)


def test_an_ascii_pcd_of_another_program_is_read(tmp_path):
    pytest.importorskip("pypcd4", reason="reads PCD files")
    text = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\n"
        "COUNT 1 1 1 1\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA ascii\n"
        "0.1 0.2 0.3 4e6\n1 2 3 4e6\n"
    )
    (tmp_path / "c.pcd").write_text(text)
    np.testing.assert_allclose(load_cloud(tmp_path / "c.pcd"), [[0.1, 0.2, 0.3], [1, 2, 3]])
    old = text.replace("VERSION 0.7", "VERSION .5").replace("VIEWPOINT 0 0 0 1 0 0 0\n", "")
    (tmp_path / "c.pcd").write_text(old)
    np.testing.assert_allclose(load_cloud(tmp_path / "c.pcd"), [[0.1, 0.2, 0.3], [1, 2, 3]])


def test_arrays_are_read(tmp_path):
    np.save(tmp_path / "c.npy", WITH_NAN)
    np.savez(tmp_path / "c.npz", positions=WITH_NAN, normals=WITH_NAN)
    np.savez(tmp_path / "one.npz", cloud=WITH_NAN)
    organised = np.zeros((5, 10, 4), np.float32)
    organised[..., :3] = POINTS.reshape(5, 10, 3)
    np.save(tmp_path / "organised.npy", organised)
    for name in ("c.npy", "c.npz", "one.npz", "organised.npy"):
        np.testing.assert_allclose(load_cloud(tmp_path / name), POINTS)


def test_other_units_are_read_by_their_scale_and_else_refused(tmp_path):
    np.save(tmp_path / "mm.npy", 1000 * POINTS)
    np.testing.assert_allclose(load_cloud(tmp_path / "mm.npy", scale=0.001), POINTS, atol=1e-6)
    with pytest.raises(InputError, match=r"0\.001"):
        load_cloud(tmp_path / "mm.npy")


def test_other_arrays_are_refused(tmp_path):
    np.save(tmp_path / "flat.npy", np.zeros(9))
    np.save(tmp_path / "words.npy", np.array([["a", "b", "c"]]))
    np.savez(tmp_path / "two.npz", a=POINTS, b=POINTS)
    np.save(tmp_path / "columns.npy", POINTS.T)
    np.save(tmp_path / "cm.npy", 100 * POINTS)
    np.save(tmp_path / "nan.npy", np.full((4, 3), np.nan))
    np.save(tmp_path / "object.npy", np.array([{}, 1], dtype=object), allow_pickle=True)
    expected = {
        "flat.npy": "shape",
        "words.npy": "holds no points",
        "two.npz": "name the points",
        "columns.npy": "transpose",
        "cm.npy": "give the scale",
        "nan.npy": "no finite point",
        "object.npy": "NPY",
    }
    for name, words in expected.items():
        with pytest.raises(InputError, match=words):
            load_cloud(tmp_path / name)


@pytest.mark.parametrize("suffix", ["pcd", "ply", "npz", "npy"])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_cut_files_are_refused(tmp_path, suffix, share):
    path = tmp_path / f"c.{suffix}"
    if suffix == "pcd":
        pcd(path, "binary")
    elif suffix == "ply":
        ply(path, text=False)
    elif suffix == "npz":
        np.savez(path, positions=POINTS)
    else:
        np.save(path, POINTS)
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(InputError, match=path.name):
        load_cloud(path)


def test_other_files_are_refused(tmp_path):
    (tmp_path / "c.stl").write_text("solid")
    with pytest.raises(InputError, match=r"\.pcd"):
        load_cloud(tmp_path / "c.stl")
    with pytest.raises(InputError, match=r"gone\.npy"):
        load_cloud(tmp_path / "gone.npy")
