"""Draw a Drake diagram: its systems, what they send, and to whom.

  diagram.py                     the whole reach
  diagram.py station             the simulated robot
  diagram.py reaching --depth 2  the reach with the station opened
  diagram.py --set station.stereo=true  the reach of another scenario

Results: NAME.svg, a picture that needs nothing else; NAME.dot, every port for Graphviz; and
NAME_ports.svg, the same drawn, where Graphviz's program dot is installed.
"""

import logging
import shutil
import subprocess
from argparse import ArgumentParser, ArgumentTypeError

from pydrake.systems.framework import Diagram

from pepper_drake import cli
from pepper_drake.cli_scenario import add_scenario_options, scenario_of
from pepper_drake.diagrams.station import PepperStation
from pepper_drake.diagrams.teaching import Teaching
from pepper_drake.models.control_model import shared_control_model
from pepper_drake.models.scene import SCENES, load_scene
from pepper_drake.reporting.diagram_graph import make_diagram_graph
from pepper_drake.reporting.diagram_picture import save_diagram_picture
from pepper_drake.results.folder import whole_results
from pepper_drake.scenario import Scenario, build_reaching

DIAGRAMS = ("reaching", "station", "teaching")


def make_parser() -> ArgumentParser:
    """Makes the parser of this app's options."""
    parser = cli.make_parser("diagram", __doc__)
    parser.add_argument(
        "name",
        nargs="?",
        default="reaching",
        choices=DIAGRAMS,
        help="which diagram (default: %(default)s)",
    )
    parser.add_argument(
        "--depth",
        type=_depth,
        default=1,
        metavar="N",
        help="how many levels of nested diagrams are shown (default: %(default)s)",
    )
    parser.add_argument(
        "--scene",
        metavar="NAME|FILE",
        help=f"one of {', '.join(SCENES)}, or a scene's YAML file (default: the scenario's, table)",
    )
    add_scenario_options(parser)
    return parser


def _depth(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise ArgumentTypeError(f'"{text}" is not a depth; give a whole number, 1 or above')
    return int(text)


def build(name: str, scenario: Scenario) -> Diagram:
    """Builds one of the `DIAGRAMS` by name."""
    scene = scenario.scene
    diagram: Diagram
    if name == "station":
        config = scenario.reaching_config().station
        diagram = PepperStation(scene, config, shared_control_model())
    elif name == "teaching":
        diagram = Teaching(scene.arm, scene.robot.positions())
    else:
        diagram = build_reaching(scenario)
    diagram.set_name(name)
    return diagram


def main() -> int:
    """Runs the app."""
    options = cli.parse(make_parser())
    logging.getLogger("drake").setLevel(logging.WARNING)
    scenario = scenario_of(options)
    if options.scene is not None:
        scenario.scene = load_scene(options.scene)
    diagram = build(options.name, scenario)
    dot, picture, ports = (f"{options.name}{end}" for end in (".dot", ".svg", "_ports.svg"))
    graph = make_diagram_graph(diagram, options.depth)
    lines = [
        f"{options.output / picture} shows {len(graph.nodes)} systems; "
        f"{options.output / dot} has every port"
    ]
    program = shutil.which("dot")
    with whole_results(options.output, (dot, picture, ports)) as folder:
        (folder / dot).write_text(diagram.GetGraphvizString(options.depth), encoding="utf-8")
        save_diagram_picture(graph, type(diagram).__name__, folder / picture)
        if program is None:
            lines.append(
                "The picture of every port needs the program dot (Debian/Ubuntu package graphviz)"
            )
        else:
            command = [program, "-Tsvg", str(folder / dot), "-o", str(folder / ports)]
            subprocess.run(command, check=True)
            lines.append(f"{options.output / ports} draws every port")
    if not options.quiet:
        print("\n".join(lines))
    return cli.EXIT_DONE


if __name__ == "__main__":
    cli.run(main)
