import numpy as np

from pepper_drake.models.control_model import BODY_JOINTS
from pepper_drake.models.pepper import JOINT_GROUPS, posture_positions
from pepper_drake.systems.robot.joint_command_merge import JointCommandMerge

GROUPS = {"head": JOINT_GROUPS["head"], "arm": JOINT_GROUPS["right_arm"]}
RESTING = posture_positions("stand", {})


def test_each_joint_gets_its_groups_command_and_all_others_rest():
    system = JointCommandMerge(GROUPS, RESTING)
    context = system.CreateDefaultContext()
    system.GetInputPort("head_command").FixValue(context, [0.1, 0.2])
    system.GetInputPort("arm_command").FixValue(context, [1, 2, 3, 4, 5])
    command = dict(zip(BODY_JOINTS, system.get_output_port().Eval(context), strict=True))
    assert (command["HeadYaw"], command["HeadPitch"]) == (0.1, 0.2)
    assert [command[name] for name in JOINT_GROUPS["right_arm"]] == [1, 2, 3, 4, 5]
    for name in (*JOINT_GROUPS["left_arm"], *JOINT_GROUPS["body"]):
        assert command[name] == RESTING[name]


def test_the_command_follows_every_group_and_leaves_no_trace_of_the_last(ports):
    rig = ports(JointCommandMerge(GROUPS, RESTING))
    changed = rig.changes(
        {"head_command": np.zeros(2), "arm_command": np.zeros(5)},
        {"head_command": np.ones(2), "arm_command": np.ones(5)},
    )
    command = "joint_position_command"
    assert changed == {("head_command", command), ("arm_command", command)} == rig.feedthrough()
