"""ArUco markers as textured meshes, for the VTK renderer and for meshcat."""

import cv2
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh

DICTIONARY = cv2.aruco.DICT_4X4_50
_MODULES = 6
"""Width of the black square in modules: four code modules and the border."""
_PIXELS_PER_MODULE = 40

_OBJ = """mtllib marker.mtl
v -{h} -{h} 0
v {h} -{h} 0
v {h} {h} 0
v -{h} {h} 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0 1
usemtl marker
f 1/1/1 2/2/1 3/3/1
f 1/1/1 3/3/1 4/4/1
"""

_MTL = """newmtl marker
Kd 1 1 1
map_Kd marker.png
"""


def plate_size(size: float) -> float:
    """Returns the edge [m] of a marker's white plate: one module wider on every side."""
    return size * (_MODULES + 2) / _MODULES


def marker_png(marker_id: int) -> bytes:
    """Returns the PNG picture of a DICT_4X4_50 marker with a white quiet zone of one module."""
    dictionary = cv2.aruco.getPredefinedDictionary(DICTIONARY)
    square = cv2.aruco.generateImageMarker(dictionary, marker_id, _MODULES * _PIXELS_PER_MODULE)
    picture = cv2.copyMakeBorder(
        square, *[_PIXELS_PER_MODULE] * 4, borderType=cv2.BORDER_CONSTANT, value=(255,)
    )
    return cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))[1].tobytes()


def marker_mesh(marker_id: int, size: float) -> Mesh:
    """Returns a marker as an in-memory flat textured mesh.

    Its frame is the marker's: x right, y up, z out of the face, origin at the centre.

    Args:
        marker_id: The id in DICT_4X4_50.
        size: The edge of the black square without the white quiet zone [m].
    """
    return Mesh(
        mesh_data=InMemoryMesh(
            mesh_file=MemoryFile(
                _OBJ.format(h=plate_size(size) / 2).encode(), ".obj", "marker.obj"
            ),
            supporting_files={
                "marker.mtl": MemoryFile(_MTL.encode(), ".mtl", "marker.mtl"),
                "marker.png": MemoryFile(marker_png(marker_id), ".png", "marker.png"),
            },
        )
    )
