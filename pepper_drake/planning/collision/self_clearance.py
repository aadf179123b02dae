"""How near an arm comes to the rest of Pepper."""

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Role
from pydrake.systems.framework import Context

from pepper_drake.models.control_model import ControlModel
from pepper_drake.perception.mapping.solids import Solid
from pepper_drake.planning.collision.arm_geometry import ArmGeometry
from pepper_drake.planning.collision.solid_set import SolidSet
from pepper_drake.planning.collision.sphere_model import SphereModel

Vector = npt.NDArray[np.float64]

_WATCHED = ("ForeArm", "wrist")
"""The arm's links that can reach the body; those nearer to the shoulder touch it by design."""


def self_collision_spheres(spheres: SphereModel) -> npt.NDArray[np.bool_]:
    """Which of an arm's spheres (S,) can reach the robot's body."""
    return np.array([spheres.link_names[k].endswith(_WATCHED) for k in spheres.link])


class SelfClearance:
    """Distances between an arm's forearm and hand, as spheres, and the body's collision shapes.

    Args:
        model: Pepper.
        geometry: Of the arm.
    """

    def __init__(self, model: ControlModel, geometry: ArmGeometry) -> None:
        self._model, self._geometry = model, geometry
        self._watched = self_collision_spheres(geometry.spheres)
        inspector = model.diagram.scene_graph().model_inspector()
        arm = {*geometry.spheres.link_names, f"{geometry.arm[0].upper()}Shoulder"}
        self._solids: list[Solid] = []
        self._frames = []
        for index in model.plant.GetBodyIndices(model.model_instance):
            body = model.plant.get_body(index)
            frame = model.plant.GetBodyFrameIdIfExists(index)
            if frame is None or body.name() in arm:
                continue
            for shape in inspector.GetGeometries(frame, Role.kProximity):
                self._solids.append(
                    Solid(inspector.GetShape(shape), inspector.GetPoseInFrame(shape))
                )
                self._frames.append(body.body_frame())

    def body(self, context: Context) -> SolidSet:
        """The body's shapes in T, where the joints of a context of the model's plant put them."""
        torso = self._model.plant.GetFrameByName("torso")
        return SolidSet(
            [
                (solid.shape, frame.CalcPose(context, torso) @ solid.X_FS)
                for solid, frame in zip(self._solids, self._frames, strict=True)
            ]
        )

    def __call__(self, context: Context, joint_positions: Vector) -> Vector:
        """Least signed distance at each of the arm's joint positions [m].

        Args:
            context: Of the model's plant, with the body's joints set; its arm does not matter.
            joint_positions: (N, 5) the arm's [rad].

        Returns:
            (N,). The spheres bulge out of the arm's shapes: a hand that hangs beside the body, a
            few millimetres from it, has about -5 mm.
        """
        centers = self._geometry.sphere_centers(joint_positions)[:, self._watched]
        gaps = self.body(context).distance(centers) - self._geometry.spheres.radii[self._watched]
        return gaps.min(axis=1)
