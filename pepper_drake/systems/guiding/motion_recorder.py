"""Records the hand's pose and the joints at a fixed rate."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from pepper_drake.learning import Demonstration
from pepper_drake.learning.demonstrations.recording import CUTOFF, recorded_demonstration
from pepper_drake.systems.framework import Diagram, LeafSystem, build_into

Array = npt.NDArray[np.float64]


class MotionSampler(LeafSystem):
    """Packs a hand's pose and joint positions into one vector.

    .. pydrake_system::

        name: MotionSampler
        input_ports:
        - hand_pose
        - joint_position
        output_ports:
        - sample

    `hand_pose` is X_TH (RigidTransform), `joint_position` (J) [rad]; `sample` (7 + J) is position
    [m], unit quaternion w, x, y, z, joints.

    Args:
        num_joints: Number J of joints.
    """

    def __init__(self, num_joints: int) -> None:
        super().__init__()
        self.hand_pose_input = self.DeclareAbstractInputPort("hand_pose", Value(RigidTransform()))
        self.joint_position_input = self.DeclareVectorInputPort("joint_position", num_joints)
        self.sample_output = self.DeclareVectorOutputPort(
            "sample",
            7 + num_joints,
            self._calc_sample,
            {self.hand_pose_input.ticket(), self.joint_position_input.ticket()},
        )

    def _calc_sample(self, context: Context, output: BasicVector) -> None:
        X_TH = self.hand_pose_input.Eval(context)
        output.SetFromVector(
            np.r_[
                X_TH.translation(),
                X_TH.rotation().ToQuaternion().wxyz(),
                self.joint_position_input.Eval(context),
            ]
        )


class MotionRecorder(Diagram):
    """Samples a hand's pose and joints at a fixed rate; its log becomes a Demonstration.

    .. pydrake_system::

        name: MotionRecorder
        input_ports:
        - hand_pose
        - joint_position

    The ports are MotionSampler's: those of a station, simulated or real. The record is part of the
    context; the caller may write new samples to a file between two advances (see
    `RecordingWriter`), so that the diagram itself can be cloned.

    Attributes:
        joint_names: Names of the joints on the port `joint_position`.
    """

    def __init__(self, joint_names: Sequence[str], *, time_step: float = 0.01) -> None:
        """Makes the recorder.

        Args:
            joint_names: Names of the joints on the port `joint_position`.
            time_step: Step of the record [s].
        """
        super().__init__()
        self.joint_names = tuple(joint_names)
        builder = DiagramBuilder()
        sampler = builder.AddNamedSystem("sampler", MotionSampler(len(self.joint_names)))
        self._log = LogVectorOutput(sampler.sample_output, builder, publish_period=time_step)
        builder.ExportInput(sampler.hand_pose_input, "hand_pose")
        builder.ExportInput(sampler.joint_position_input, "joint_position")
        build_into(builder, self)

    def samples(self, root_context: Context) -> tuple[Array, Array]:
        """Returns the samples recorded so far in a simulation.

        Args:
            root_context: The simulation's context.

        Returns:
            Times (N,) [s] and samples (N, 7 + J), as MotionSampler packs them.
        """
        log = self._log.FindLog(root_context)
        return log.sample_times(), log.data().T

    def demonstration(
        self, root_context: Context, *, name: str = "recording", cutoff: float = CUTOFF
    ) -> Demonstration:
        """Returns the motion recorded in a simulation; see `recorded_demonstration`.

        Args:
            root_context: The simulation's context.
            name: The demonstration's name.
            cutoff: Frequency at which smoothing halves the amplitude [Hz].
        """
        times, samples = self.samples(root_context)
        return recorded_demonstration(times, samples, self.joint_names, name=name, cutoff=cutoff)
