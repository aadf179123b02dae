import io
import os
import zipfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from pepper_drake.array_files import npz_names, read_npy, read_npz
from pepper_drake.errors import InputError


@given(
    array=arrays.arrays(
        st.sampled_from(["f8", "f4", "i8", "u2", "?"]), arrays.array_shapes(min_dims=0, min_side=0)
    ),
    compress=st.booleans(),
    in_columns=st.booleans(),
)
def test_what_numpy_wrote_is_read(tmp_path_factory, array, compress, in_columns):
    path = tmp_path_factory.mktemp("npz") / "a.npz"
    array = np.asfortranarray(array) if in_columns and array.ndim else array
    (np.savez_compressed if compress else np.savez)(path, a=array, b=np.arange(3.0))
    read = read_npz(path)
    assert set(read) == npz_names(path) == {"a", "b"}
    np.testing.assert_array_equal(read["a"], array)
    assert read["a"].dtype == array.dtype
    assert set(read_npz(path, ("b", "c"))) == {"b"}


def put(path, header, content=b"", name="a.npy"):
    with zipfile.ZipFile(path, "w") as archive:
        stream = io.BytesIO()
        np.lib.format.write_array_header_1_0(stream, header)
        archive.writestr(name, stream.getvalue() + content)


@pytest.mark.parametrize(
    "header",
    [
        {"descr": "<f8", "fortran_order": False, "shape": (10**12,)},
        {"descr": "<f8", "fortran_order": False, "shape": (2**62, 8)},
        {"descr": "<f8", "fortran_order": False, "shape": (3,)},
        {"descr": "|O", "fortran_order": False, "shape": (1,)},
        {"descr": [("a", "<f8")], "fortran_order": False, "shape": (1,)},
        {"descr": "|V0", "fortran_order": False, "shape": (10**15,)},
        {"descr": "<c16", "fortran_order": False, "shape": (1,)},
    ],
)
def test_a_header_that_lies_is_refused(tmp_path, header):
    path = tmp_path / "a.npz"
    put(path, header, bytes(16))
    with pytest.raises(InputError, match=r"a\.npz: not an npz file of numbers"):
        read_npz(path)


def test_a_bomb_is_refused_before_it_goes_off(tmp_path):
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", bytes(200 * 2**20))
    assert path.stat().st_size < 2**20
    with pytest.raises(InputError, match=r"bomb\.npz: holds more than 128 MiB"):
        read_npz(path)


def test_pickles_npy_files_and_pipes_are_refused(tmp_path):
    path = tmp_path / "a.npz"
    with path.open("wb") as file:
        np.save(file, np.arange(3.0))
    with pytest.raises(InputError, match="not an npz file"):
        read_npz(path)
    with path.open("wb") as file:
        np.savez(file, a=np.array([{}], dtype=object))
    with pytest.raises(InputError, match="not an npz file"):
        read_npz(path)
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(InputError, match="not a regular file"):
        read_npz(path)


def test_an_array_alone_is_read_and_what_is_none_is_refused(tmp_path):
    path = tmp_path / "a.npy"
    np.save(path, np.arange(6).reshape(2, 3))
    np.testing.assert_array_equal(read_npy(path), [[0, 1, 2], [3, 4, 5]])
    good = path.read_bytes()
    # A header in which a bracket stays open, and one that claims more numbers than there are.
    for wrong in (good.replace(b"(2, 3)", b"((2, 3"), good.replace(b"(2, 3)", b"(9, 3)")):
        assert wrong != good
        path.write_bytes(wrong)
        with pytest.raises(InputError, match=r"a\.npy: not an NPY file"):
            read_npy(path)
