"""Draws Pepper and its scene on a viser page: the shapes of Drake's SceneGraph."""

from collections.abc import Callable, Mapping

import cv2
import numpy as np
import numpy.typing as npt
import trimesh
import viser
from pydrake.geometry import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    FrameId,
    Mesh,
    QueryObject,
    Rgba,
    Role,
    SceneGraphInspector,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.models.markers import marker_png, plate_size

Vector = npt.NDArray[np.float64]

_FLIP = RotationMatrix(np.diag([1.0, -1.0, -1.0]))
"""Viser's images have z into the image and y down; markers have z out of the marker and y up."""
_STILL = 1e-5
"""Change of a pose below which it is not sent again [m, or of a quaternion]."""


def triangles_of(shape: Shape) -> trimesh.Trimesh | None:
    """Returns a shape as a triangle mesh in its own frame [m]; None for unsupported shapes."""
    if isinstance(shape, Box):
        return trimesh.creation.box(extents=shape.size())
    if isinstance(shape, Sphere):
        return trimesh.creation.icosphere(subdivisions=3, radius=shape.radius())
    if isinstance(shape, Cylinder):
        return trimesh.creation.cylinder(radius=shape.radius(), height=shape.length(), sections=32)
    if isinstance(shape, Capsule):
        return trimesh.creation.capsule(
            radius=shape.radius(), height=shape.length(), count=[16, 16]
        )
    if isinstance(shape, Ellipsoid):
        mesh = trimesh.creation.icosphere(subdivisions=3)
        mesh.apply_scale([shape.a(), shape.b(), shape.c()])
        return mesh
    if isinstance(shape, Mesh) and not shape.source().is_in_memory():
        mesh = trimesh.load_mesh(shape.source().path())
        mesh.apply_scale(shape.scale3())
        return mesh
    return None


class RobotDrawing:
    """Draws all bodies of a SceneGraph, and moves them.

    Attributes:
        bodies: Frame of each body in the scene tree, by the body's name.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        inspector: SceneGraphInspector,
        *,
        marker: tuple[int, float],
        draggable: Mapping[str, Callable[[viser.SceneNodeDragEvent], None]],
        labels: Mapping[str, str],
    ) -> None:
        """Draws all bodies in their default poses.

        Args:
            server: Server of the page.
            inspector: Inspector of the SceneGraph.
            marker: Number and size [m] of the goal's marker.
            draggable: Callbacks for dragging with the mouse, by the body's name.
            labels: Labels above bodies, by the body's name.
        """
        self._server, self._marker = server, marker
        self.bodies: dict[str, viser.FrameHandle] = {}
        self._frames: dict[FrameId, viser.FrameHandle] = {}
        self._sent: dict[FrameId, Vector] = {}
        for frame in inspector.GetAllFrameIds():
            geometries = inspector.GetGeometries(frame, Role.kIllustration)
            if not geometries:
                continue
            body = inspector.GetName(frame).split("::")[-1]
            name = f"/bodies/{frame.get_value()}_{body}"
            node = server.scene.add_frame(name, show_axes=False)
            self._frames[frame] = self.bodies[body] = node
            for index, geometry in enumerate(geometries):
                shape = inspector.GetShape(geometry)
                looks = inspector.GetIllustrationProperties(geometry)
                color = looks.GetPropertyOrDefault("phong", "diffuse", Rgba(0.9, 0.9, 0.9, 1.0))
                X = inspector.GetPoseInFrame(geometry)
                handle = self._draw(f"{name}/{index}", shape, X, color)
                if handle is not None and body in draggable:
                    handle.on_drag(draggable[body])
                if body in labels and index == 0:
                    mesh = triangles_of(shape)
                    top = X.translation()[2] + (mesh.bounds[1][2] if mesh is not None else 0.0)
                    server.scene.add_label(
                        f"{name}/label",
                        labels[body],
                        position=(0.0, 0.0, top + 0.02),
                        font_screen_scale=0.8,
                        anchor="bottom-center",
                    )

    def _draw(
        self, name: str, shape: Shape, X: RigidTransform, color: Rgba
    ) -> viser.MeshHandle | viser.ImageHandle | None:
        wxyz, position = X.rotation().ToQuaternion().wxyz(), X.translation()
        mesh = triangles_of(shape)
        if mesh is not None:
            return self._server.scene.add_mesh_simple(
                name,
                np.asarray(mesh.vertices, dtype=np.float32),
                np.asarray(mesh.faces, dtype=np.uint32),
                color=tuple(round(255 * value) for value in (color.r(), color.g(), color.b())),
                opacity=None if color.a() >= 1.0 else color.a(),
                flat_shading=isinstance(shape, Box),
                wxyz=wxyz,
                position=position,
            )
        number, size = self._marker
        picture = cv2.imdecode(np.frombuffer(marker_png(number), np.uint8), cv2.IMREAD_COLOR)
        edge = plate_size(size)
        return self._server.scene.add_image(
            name,
            picture,
            edge,
            edge,
            wxyz=(X.rotation() @ _FLIP).ToQuaternion().wxyz(),
            position=position,
        )

    def update(self, query: QueryObject) -> None:
        """Moves the bodies to their present poses."""
        for frame, node in self._frames.items():
            X = query.GetPoseInWorld(frame)
            pose = np.concatenate((X.translation(), X.rotation().ToQuaternion().wxyz()))
            before = self._sent.get(frame)
            if before is not None and np.abs(pose - before).max() < _STILL:
                continue
            self._sent[frame] = pose
            node.position, node.wxyz = pose[:3], pose[3:]
