"""Rejects estimates that are not finite or not plausible before they are used."""

from dataclasses import dataclass

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.perception import PointCloud
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiscreteValues,
    EventStatus,
    InputPort,
    State,
)

from pepper_drake.systems.framework import LeafSystem, ValueProducer

_FARTHEST = 12.0
"""A distance beyond the range of all depth cameras [m]."""
_FARTHEST_GOAL = 100.0
"""Distance from the world's origin at which a goal is implausible [m]."""
_LARGEST_SHARE = 0.02
"""A cloud with a larger fraction of implausible points is rejected."""


class PoseGuard(LeafSystem):
    """Passes a pose through; while it is not finite or far away, outputs the last valid pose.

    .. pydrake_system::

        name: PoseGuard
        input_ports:
        - pose
        output_ports:
        - pose
        - age

    Input and output: `pose`, a RigidTransform; `age` (1), time since the pose was valid at a tick
    [s], 0 while it is. State: the last valid pose (abstract) and its age, at `time_step`.

    Args:
        time_step: Period of the update [s].
    """

    def __init__(self, *, time_step: float = 0.05) -> None:
        super().__init__()
        self._time_step = time_step
        self.pose_input: InputPort = self.DeclareAbstractInputPort("pose", Value(RigidTransform()))
        self._pose = self.DeclareAbstractState(Value(RigidTransform()))
        self._age = self.DeclareDiscreteState(1)
        self.DeclareAbstractOutputPort(
            "pose",
            lambda: Value(RigidTransform()),
            self._calc_pose,
            prerequisites_of_calc={
                self.abstract_state_ticket(self._pose),
                self.pose_input.ticket(),
            },
        )
        self.DeclareStateOutputPort("age", self._age)
        self.DeclarePeriodicUnrestrictedUpdateEvent(time_step, 0.0, self._update)
        # Updated together with the discrete state of its readers, not before.
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update_age)

    def _is_valid(self, context: Context) -> bool:
        pose = self.pose_input.Eval(context).GetAsMatrix34()
        return bool(np.isfinite(pose).all() and np.abs(pose[:, 3]).max() < _FARTHEST_GOAL)

    def _update(self, context: Context, state: State) -> EventStatus:
        if not self._is_valid(context):
            return EventStatus.DidNothing()
        state.get_mutable_abstract_state(int(self._pose)).set_value(self.pose_input.Eval(context))
        return EventStatus.Succeeded()

    def _update_age(self, context: Context, discrete_state: DiscreteValues) -> None:
        age = context.get_discrete_state(self._age).value()[0] + self._time_step
        discrete_state.set_value(self._age, [0.0 if self._is_valid(context) else age])

    def _calc_pose(self, context: Context, output: Value) -> None:
        finite = self._is_valid(context)
        kept = context.get_abstract_state(int(self._pose)).get_value()
        output.set_value(self.pose_input.Eval(context) if finite else kept)


@dataclass(frozen=True)
class _Clouds:
    """The last plausible clouds, with their time stamp; immutable."""

    cloud: AbstractValue
    cloud_torso: AbstractValue
    stamp: float

    def __deepcopy__(self, memo: dict) -> "_Clouds":
        return self


class CloudGuard(LeafSystem):
    """Passes plausible clouds through; otherwise outputs the last plausible, with their time stamp.

    A cloud is implausible if more than a few of its points are not finite or beyond the range of
    any depth camera. The time stamp then stops, so that its readers notice.

    .. pydrake_system::

        name: CloudGuard
        input_ports:
        - cloud
        - cloud_torso
        - time_stamp
        output_ports:
        - cloud
        - cloud_torso
        - time_stamp

    Inputs and outputs: `cloud` in W and `cloud_torso` in T (PointCloud); `time_stamp` (1) [s].
    State: the last plausible clouds (abstract), at `time_step`.

    Args:
        time_step: Period of the update [s].
    """

    def __init__(self, *, time_step: float = 0.05) -> None:
        super().__init__()
        model = Value(PointCloud())
        self._cloud: InputPort = self.DeclareAbstractInputPort("cloud", model)
        self._cloud_torso: InputPort = self.DeclareAbstractInputPort("cloud_torso", model)
        self._time_stamp: InputPort = self.DeclareVectorInputPort("time_stamp", 1)
        nothing = _Clouds(model.Clone(), model.Clone(), -np.inf)
        self._last = self.DeclareAbstractState(Value[object](nothing))
        state = self.abstract_state_ticket(self._last)
        self._plausible = self.DeclareCacheEntry(
            "whether the clouds make sense",
            ValueProducer(allocate=lambda: Value[object](True), calc=self._calc_plausible),
            prerequisites_of_calc={self._cloud.ticket(), self._cloud_torso.ticket()},
        )
        for port in (self._cloud, self._cloud_torso):
            self._declare_cloud(port, {state, port.ticket(), self._plausible.ticket()})
        self.DeclareVectorOutputPort(
            "time_stamp",
            1,
            self._calc_stamp,
            prerequisites_of_calc={state, self._time_stamp.ticket(), self._plausible.ticket()},
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(time_step, 0.0, self._update)

    def _declare_cloud(self, port: InputPort, ready: set) -> None:
        name, index = port.get_name(), port.get_index()

        def calc(context: Context, output: AbstractValue) -> None:
            if self._plausible.Eval(context):
                output.SetFrom(self.EvalAbstractInput(context, index))
            else:
                output.SetFrom(getattr(self._kept(context), name))

        self.DeclareAbstractOutputPort(
            name, lambda: Value(PointCloud()), calc, prerequisites_of_calc=ready
        )

    def _kept(self, context: Context) -> _Clouds:
        return context.get_abstract_state(int(self._last)).get_value()

    def _calc_plausible(self, context: Context, plausible: Value) -> None:
        clouds = (self._cloud.Eval(context), self._cloud_torso.Eval(context))
        plausible.set_value(all(makes_sense(cloud) for cloud in clouds))

    def _update(self, context: Context, state: State) -> EventStatus:
        stamp = float(self._time_stamp.Eval(context)[0])
        if stamp == self._kept(context).stamp or not self._plausible.Eval(context):
            return EventStatus.DidNothing()
        cloud, cloud_torso = (
            self.EvalAbstractInput(context, port.get_index()).Clone()
            for port in (self._cloud, self._cloud_torso)
        )
        clouds = _Clouds(cloud, cloud_torso, stamp)
        state.get_mutable_abstract_state(int(self._last)).set_value(clouds)
        return EventStatus.Succeeded()

    def _calc_stamp(self, context: Context, output: BasicVector) -> None:
        present = bool(self._plausible.Eval(context))
        stamp = self._time_stamp.Eval(context)[0] if present else self._kept(context).stamp
        output.SetAtIndex(0, float(stamp))


def makes_sense(cloud: PointCloud) -> bool:
    """Tells whether nearly all points of a cloud are finite and within a depth camera's range."""
    points = cloud.xyzs()
    if points.size == 0:
        return True
    implausible = ~(np.abs(points) < _FARTHEST).all(axis=0)
    return bool(np.count_nonzero(implausible) <= _LARGEST_SHARE * points.shape[1])
