"""Formats that are not read, by name, and how to export their content."""

from pathlib import Path

from pepper_drake.errors import InputError

_TABLE = (
    "export the motion as a table (CSV) with a first line time,x,y,z or time,RShoulderPitch,..."
)
_NUMPY = 'np.savetxt("motion.csv", table, delimiter=",", header="time,x,y,z", comments="")'

_TIMELINE = (
    "copy the timeline with its Export motion to clipboard, Python (names.append(...),"
    " times.append(...), keys.append(...)), or give behavior.xar"
)

_STARTS: tuple[tuple[bytes, str, str], ...] = (
    (b"\x93NUMPY", "a NumPy array, which does not say what its columns are", f"write {_NUMPY}"),
    (b"\x89HDF", "an HDF5 file", _TABLE),
    (b"MATLAB 7.3", "a MATLAB 7.3 file", "save it again with -v7, or as a table"),
    (b"\x1f\x8b", "a gzip archive", "unpack it (gunzip) and give the file in it"),
    (b"7z\xbc\xaf", "a 7z archive", "unpack it and give the file in it"),
    (b"BZh", "a bzip2 archive", "unpack it (bunzip2) and give the file in it"),
    (b"\xfd7zXZ", "an xz archive", "unpack it (unxz) and give the file in it"),
    (b"\xd0\xcf\x11\xe0", "an Excel workbook (.xls)", "save the sheet as CSV"),
    (b"SQLite format 3", "an SQLite database", "give the bag's folder, or its .db3 file"),
    (b"\x80\x02", "a Python pickle, which would run what is in it", _TABLE),
    (b"\x80\x03", "a Python pickle, which would run what is in it", _TABLE),
    (b"\x80\x04", "a Python pickle, which would run what is in it", _TABLE),
    (b"\x80\x05", "a Python pickle, which would run what is in it", _TABLE),
    (b"Kaydara FBX", "an FBX scene", _TABLE),
    (b"%PDF", "a PDF document", _TABLE),
    (b"\x89PNG", "a picture", "apps/perceive.py --image looks at pictures"),
    (b"\xff\xd8\xff", "a picture", "apps/perceive.py --image looks at pictures"),
    (b"HIERARCHY", "a BVH skeleton, whose joints are not Pepper's", _TABLE),
    (b"header:\n", "YAML, as rostopic echo writes it", "record a bag, or use rostopic echo -p"),
    (b"header: \n", "YAML, as rostopic echo writes it", "record a bag, or use rostopic echo -p"),
    (b"comment,", "an export of OptiTrack before version 1.2", "export it again with Motive's CSV"),
    (b"PathFileType", "an OpenSim TRC file", _TABLE),
    (b"NO_OF_FRAMES", "a Qualisys TSV file", f"{_TABLE}; its units are mm (--unit mm)"),
    (
        b"#ROSBAG V2",
        "a ROS bag by another name",
        "call it .bag; of .bag.active, rosbag reindex first",
    ),
    (b"#ROSBAG V1", "a ROS bag of version 1.x", "convert it (rosbag fix), then give it"),
)

_PAGE = (b"<!doctype", b"<html")
"""Start of a web page, in small letters; blank lines may stand before it."""

_SUFFIXES: dict[str, tuple[str, str]] = {
    ".pkl": ("a Python pickle, which would run what is in it", _TABLE),
    ".pickle": ("a Python pickle, which would run what is in it", _TABLE),
    ".c3d": ("a C3D file of motion capture", _TABLE),
    ".json": ("JSON, which has no common form of a motion", _TABLE),
    ".jsonl": ("JSON, which has no common form of a motion", _TABLE),
    ".yaml": ("YAML, as rostopic echo writes it", "record a bag, or use rostopic echo -p"),
    ".yml": ("YAML, as rostopic echo writes it", "record a bag, or use rostopic echo -p"),
    ".bvh": ("a BVH skeleton, whose joints are not Pepper's", _TABLE),
    ".feather": ("an Arrow table", _TABLE),
    ".pmt": ("Choregraphe's path of the base, which moves no arm", "give the behavior's .xar"),
}


_CODE = {".py", ".cpp", ".cc", ".c", ".h", ".m", ".java", ".js", ".ts", ".sh", ".ipynb"}


def refuse_code(path: Path) -> None:
    """Refuses program code, which is not run.

    Raises:
        InputError: The message says how to get the motion out.
    """
    if path.suffix.lower() in _CODE:
        raise InputError(
            f"{path}: program code without the lists that Choregraphe exports is not read;"
            f" {_TIMELINE}"
        )


def refuse_foreign(path: Path) -> None:
    """Refuses a file of a known format that is not read.

    Raises:
        InputError: The message names the format and how to export a table.
    """
    try:
        with path.open("rb") as file:
            start = file.read(64)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    found = next(((kind, mend) for magic, kind, mend in _STARTS if start.startswith(magic)), None)
    if start.startswith(b"PK\x03\x04"):
        kind, mend = "an archive", "unpack it and give the file in it"
        if path.suffix == ".npz":
            kind, mend = "NumPy arrays, which do not say what they are", f"write {_NUMPY}"
        elif path.suffix in (".xlsx", ".xlsm", ".ods"):
            kind, mend = "a workbook", "save the sheet as CSV"
        found = kind, mend
    if start.lstrip().lower().startswith(_PAGE):
        found = "a web page in place of the file", "download the file itself"
    found = found or _SUFFIXES.get(path.suffix.lower())
    if found is not None:
        raise InputError(f"{path}: {found[0]}, is not read; {found[1]}")
