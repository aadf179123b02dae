"""Check a robot before it is moved: nothing is moved by this, but the head with --measure.

    python apps/preflight.py --robot tcp://192.168.1.10:9559
    python apps/preflight.py --robot tcp://192.168.1.10:9559 --measure
    python apps/preflight.py --robot tcps://192.168.1.10:9503 --password-file nao.txt --arm left

Each line names a check, what was found, and how to fix it. --measure turns the head to and fro by
17 degrees, if all else is well, and fits how late and how fast it follows. Exit code 0: ready;
1: not ready.
"""

from pepper_drake import cli
from pepper_drake.hardware.motion_law import law_checks, measure_motion_law
from pepper_drake.hardware.options import add_link_options, robot_access
from pepper_drake.hardware.preflight import Check, PreflightOptions, preflight
from pepper_drake.hardware.transport import RobotAccess, make_transport
from pepper_drake.signals import run_async


async def check(
    access: RobotAccess, arm: str, options: PreflightOptions, *, measure: bool = False
) -> list[Check]:
    """Runs the preflight checks, and on request measures the motion if none failed."""
    transport = make_transport(access)
    await transport.connect()
    try:
        checks = await preflight(transport, arm, options)
        if measure and not any(check.fault for check in checks):
            checks += law_checks(await measure_motion_law(transport))
        return checks
    finally:
        await transport.close()


def main() -> int:
    """Runs the app."""
    parser = cli.make_parser("preflight", __doc__)
    add_link_options(parser, required=True, moves=False)
    parser.add_argument(
        "--arm", choices=("left", "right"), default="right", help="default: %(default)s"
    )
    parser.add_argument(
        "--measure",
        action="store_true",
        help="turn the head a little, and fit how late and how fast it follows",
    )
    options = parser.parse_args()
    access = robot_access(options)
    wanted = PreflightOptions(True, options.disable_life)
    checks = run_async(check(access, options.arm, wanted, measure=options.measure))
    if not options.quiet:
        print("\n".join(map(str, checks)))
    ready = not any(check.fault for check in checks)
    return cli.EXIT_DONE if ready else cli.EXIT_FAILED


if __name__ == "__main__":
    cli.run(main)
