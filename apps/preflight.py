"""Check a robot before it is moved: nothing is moved by this.

    python apps/preflight.py --robot tcp://192.168.1.10:9559
    python apps/preflight.py --robot tcps://192.168.1.10:9503 --password-file nao.txt --arm left

Each line names a check, what was found, and the mend. Exit code 0: ready; 1: not ready.
"""

import asyncio

from pepper_drake import cli
from pepper_drake.hardware.options import add_link_options, robot_access
from pepper_drake.hardware.preflight import Check, PreflightOptions, preflight
from pepper_drake.hardware.transport import RobotAccess, make_transport


async def check(access: RobotAccess, arm: str, options: PreflightOptions) -> list[Check]:
    """Connects, checks, and leaves."""
    transport = make_transport(access)
    await transport.connect()
    try:
        return await preflight(transport, arm, options)
    finally:
        await transport.close()


def main() -> int:
    """Runs the app."""
    parser = cli.make_parser("preflight", __doc__)
    add_link_options(parser, required=True, moves=False)
    parser.add_argument(
        "--arm", choices=("left", "right"), default="right", help="default: %(default)s"
    )
    options = parser.parse_args()
    access = robot_access(options)
    checks = asyncio.run(check(access, options.arm, PreflightOptions(True, options.disable_life)))
    if not options.quiet:
        print("\n".join(map(str, checks)))
    ready = not any(check.fault for check in checks)
    return cli.EXIT_DONE if ready else cli.EXIT_FAILED


if __name__ == "__main__":
    cli.run(main)
