"""A planned motion as a page for any browser."""

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Meshcat, MeshcatVisualizer
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.systems.framework import DiagramBuilder

from pepper_drake.benchmarking.known_scene import GroundTruthScene
from pepper_drake.diagrams.reach_drawing import frame_view
from pepper_drake.models.objects import add_scene
from pepper_drake.models.pepper import add_pepper
from pepper_drake.systems.framework import build
from pepper_drake.web.drake_page import offline_meshcat

Array = npt.NDArray[np.float64]


_STRIDE = 3
"""Stride through the motion's samples, which are 10 ms apart."""


def record_motion(known: GroundTruthScene, motion: Array, base_pose: Array) -> str:
    """Returns a stand-alone page that plays a motion (N, 5) of the arm [rad] in its scene."""
    with offline_meshcat() as meshcat:
        return _record(meshcat, known, motion, base_pose)


def _record(meshcat: Meshcat, known: GroundTruthScene, motion: Array, base_pose: Array) -> str:
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlant(MultibodyPlantConfig(time_step=0.0), builder)
    add_pepper(plant)
    add_scene(plant, known.scene)
    plant.Finalize()
    frame_view(meshcat, known.scene)
    visualizer = MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
    diagram = build(builder)
    context = diagram.CreateDefaultContext()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    visualizer.StartRecording(False)
    for number in range(0, len(motion), _STRIDE):
        time = 0.01 * number
        known.set_time(time)
        context.SetTime(time)
        plant.SetPositions(plant_context, known.positions(motion[number], base_pose))
        diagram.ForcedPublish(context)
    visualizer.StopRecording()
    visualizer.PublishRecording()
    return meshcat.StaticHtml()
