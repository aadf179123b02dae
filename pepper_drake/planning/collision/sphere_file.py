"""Pepper's collision spheres as a file for planners that check spheres."""

import numpy as np

from pepper_drake.models.control_model import shared_control_model
from pepper_drake.models.description import LINK_SHIFTS, shaped_links
from pepper_drake.planning.collision.sphere_model import make_link_spheres


def sphere_yaml() -> str:
    """Returns `collision_spheres`: centre and radius of each, by link of the standard URDF [m].

    The package's own planner uses the same spheres; they do not cover the sharp corners of boxes.
    """
    names = shaped_links()
    model = make_link_spheres(shared_control_model(), names)
    lines = ["# Made by `pepper-drake describe`: do not edit. Metres.", "collision_spheres:"]
    for number, name in enumerate(names):
        height = LINK_SHIFTS[name][2] if name in LINK_SHIFTS else 0.0
        lines.append(f"  {name}:")
        own = model.link == number
        for center, radius in zip(model.centers[own], model.radii[own], strict=True):
            # Adding zero turns a rounded -0.0 into 0.0: the file does not depend on the machine.
            x, y, z = np.round(center - [0.0, 0.0, height], 6) + 0.0
            lines.append(f"    - center: [{x:.6f}, {y:.6f}, {z:.6f}]")
            lines.append(f"      radius: {radius:.6f}")
    return "\n".join(lines) + "\n"
