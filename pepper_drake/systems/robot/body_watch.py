"""Clearance of the whole body to the cloud: head, torso, tablet, base, and arms at rest."""

import math

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.perception import PointCloud
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, InputPort

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import BODY_JOINTS, ControlModel
from pepper_drake.planning.collision.body_clearance import BodyClearance, body_links
from pepper_drake.planning.collision.own_approach import own_approach_clearance
from pepper_drake.systems.framework import LeafSystem
from pepper_drake.systems.primitive.obstacle_field_cache import ObstacleFieldCache

_HIP = np.array([name == "HipPitch" for name in BODY_JOINTS], dtype=float)
"""Direction of the hip's motion in joint space (15)."""


class BodyWatch(LeafSystem):
    """Smallest distance of the body to the cloud, now and on the braking path of base and hip.

    .. pydrake_system::

        name: BodyWatch
        input_ports:
        - cloud
        - predicted_cloud (optional)
        - joint_position
        - base_pose
        - base_velocity_command
        - hip_velocity (optional)
        - active
        output_ports:
        - clearance
        - approach_clearance
        - stop_base

    Inputs: `cloud` and `predicted_cloud`, PointClouds in W; `joint_position` (15) [rad];
    `base_pose` (3), x, y in m and yaw in rad; `base_velocity_command` (3) in the base frame B;
    `hip_velocity` (1), commanded [rad/s];
    `active` (1), not zero while the reaching arm is monitored separately.
    Outputs: `clearance` (1) [m], present distance to the cloud, infinite before the first tick and
    for an empty cloud; `approach_clearance` (1) [m], the same, but infinite unless the body's own
    motion since the last tick reduced it (`planning.collision.own_approach`): stopping a body at
    rest does not help against an approaching obstacle. `stop_base` (1), 1 while on the braking path
    of base and hip the clearance to an obstacle, present or predicted, falls below `stop_distance`
    and below the present clearance.
    State: the outputs, the base's pose and the joints, every `time_step`. The body is approximated
    by spheres that protrude by up to 1 cm.

    Args:
        model: Pepper.
        arm: The reaching arm, "left" or "right": part of the body while at rest.
        stop_distance: Clearance below which the base stops [m].
        acceleration: Deceleration of the base along the floor [m/s^2].
        turning_acceleration: Deceleration of its yaw rate [rad/s^2].
        hip_acceleration: Deceleration of the hip [rad/s^2].
        delay: Time until it begins to brake [s].
        slowest_approach: Speed below which it is at rest [m/s]; see `own_approach_clearance`.
        time_step: Period [s].
    """

    def __init__(
        self,
        model: ControlModel,
        arm: str,
        *,
        stop_distance: float = 0.01,
        acceleration: float = 0.3,
        turning_acceleration: float = 0.75,
        hip_acceleration: float = 0.5,
        delay: float = 0.1,
        slowest_approach: float = 0.01,
        time_step: float = 0.05,
    ) -> None:
        super().__init__()
        self._resting = BodyClearance(model, body_links(model))
        self._reaching = BodyClearance(model, body_links(model, without_arm=arm))
        self._stop_distance = stop_distance
        self._deceleration = acceleration, turning_acceleration, hip_acceleration
        self._delay, self._time_step = delay, time_step
        self._slowest = slowest_approach
        self._ports: dict[str, InputPort] = {
            name: self.DeclareAbstractInputPort(name, Value(PointCloud()))
            for name in ("cloud", "predicted_cloud")
        }
        self._field = ObstacleFieldCache(self, self._ports["cloud"], extension=0.0)
        self._predicted = ObstacleFieldCache(self, self._ports["predicted_cloud"], extension=0.0)
        for name, size in (
            ("joint_position", len(BODY_JOINTS)),
            ("base_pose", 3),
            ("base_velocity_command", 3),
            ("hip_velocity", 1),
            ("active", 1),
        ):
            self._ports[name] = self.DeclareVectorInputPort(name, size)
        self._state = self.DeclareDiscreteState([np.inf, np.inf, 0.0])
        self._posture = self.DeclareDiscreteState(np.full(3 + len(BODY_JOINTS), np.nan))
        state = {self.discrete_state_ticket(self._state)}
        for index, name in enumerate(("clearance", "approach_clearance", "stop_base")):
            self._declare_part(name, index, state)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _declare_part(self, name: str, index: int, state: set) -> None:
        def calc(context: Context, output: BasicVector) -> None:
            output.SetAtIndex(0, context.get_discrete_state(self._state).value()[index])

        self.DeclareVectorOutputPort(name, 1, calc, prerequisites_of_calc=state)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        pose = self._ports["base_pose"].Eval(context)
        v_B = self._ports["base_velocity_command"].Eval(context)
        active = self._ports["active"].Eval(context)[0] > 0.5
        hip = self._ports["hip_velocity"]
        leaning = float(hip.Eval(context)[0]) if hip.HasValue(context) else 0.0
        speed, turning = math.hypot(*v_B[:2].tolist()), abs(float(v_B[2]))
        moves = max(speed, turning, abs(leaning)) > 1e-3
        # Poses and hip angles at half and at the full braking distance.
        braking_path = np.zeros(3)
        duration = self._delay + 0.5 * speed / self._deceleration[0]
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        v_W = np.array([cos * v_B[0] - sin * v_B[1], sin * v_B[0] + cos * v_B[1]])
        braking_path[:2] = duration * v_W
        braking_path[2] = v_B[2] * (self._delay + 0.5 * turning / self._deceleration[1])
        shares = [0.0, 0.5, 1.0] if moves else [0.0]
        poses = pose + np.outer(shares, braking_path)
        hip_path = leaning * (self._delay + 0.5 * abs(leaning) / self._deceleration[2])
        body = self._reaching if active else self._resting
        joints = self._ports["joint_position"].Eval(context)
        field = self._field.eval(context)

        def clearances_to(obstacles: PointCloudDistance) -> npt.NDArray[np.float64]:
            if leaning == 0.0:
                return body(poses, joints, obstacles)
            leant = joints + np.outer(np.multiply(shares, hip_path), _HIP)
            pairs = zip(poses, leant, strict=True)
            return np.array([body(one[None], posture, obstacles)[0] for one, posture in pairs])

        clearances = clearances_to(field)
        now, approached, stop = float(clearances[0]), np.inf, False
        if moves:
            soon = np.minimum(clearances, clearances_to(self._predicted.eval(context)))
            ahead = float(soon.min())
            stop = ahead < self._stop_distance and ahead < soon[0] - 1e-4
        before = context.get_discrete_state(self._posture).value()
        if not now >= self._stop_distance and not np.isnan(before).any():
            earlier = float(body(before[None, :3], before[3:], field)[0])
            approached = own_approach_clearance(earlier, now, self._time_step, self._slowest)
        discrete_state.set_value(self._posture, np.concatenate((pose, joints)))
        discrete_state.set_value(self._state, [now, approached, float(stop)])
