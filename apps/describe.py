"""Write Pepper's description for other programs.

  describe.py --output pepper

The folder gets pepper_standard.urdf (no tags of Drake's), pepper.srdf (groups, postures, pairs of
links that are not checked), pepper_mjcf.xml (MuJoCo) and pepper_spheres.yaml (collision spheres).
All are made from the URDF that Drake reads. The URDF has cylinders around the source's capsules.
"""

from pathlib import Path

from pepper_drake import cli
from pepper_drake.files import write_atomically
from pepper_drake.models.description import description_files
from pepper_drake.planning.collision.sphere_file import sphere_yaml


def main() -> int:
    """Runs the app."""
    options = cli.parse(cli.make_parser("describe", __doc__))
    options.output.mkdir(parents=True, exist_ok=True)
    for name, text in (description_files() | {Path("pepper_spheres.yaml"): sphere_yaml()}).items():
        write_atomically(options.output / name, text)
        if not options.quiet:
            print(f"wrote {options.output / name}")
    return cli.EXIT_DONE


if __name__ == "__main__":
    cli.run(main)
