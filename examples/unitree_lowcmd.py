"""A G1 that stands on Unitree's messages: LowState in, LowCmd out, 500 times a second.

    python examples/unitree_lowcmd.py                                # both in one process
    python examples/unitree_lowcmd.py --role robot --interface lo    # with unitree_sdk2py: the
    python examples/unitree_lowcmd.py --role controller --interface lo  # two as processes

No band holds the robot. It is simulated in plain MuJoCo with the delays, motors and sensor noise of
`--realism`, is pushed forward after 2 s, and has no sensors of force: the ground's wrench comes
from the torques of its legs. Never tried on a real robot.
"""

import argparse

from poise.training import LowCmdBridge, LowCmdRobot

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("controller", nargs="?", default="momentum-qp-g1")
parser.add_argument("--realism", default="field", help="level of delays, motors and noise")
parser.add_argument("--targets", action="store_true", help="command positions, not torques")
parser.add_argument("--impulse", type=float, default=10.0, help="of the push [N·s]")
parser.add_argument("--seconds", type=float, default=10.0)
parser.add_argument("--role", choices=("both", "robot", "controller"), default="both")
parser.add_argument("--interface", default="lo", help="of the network, for two processes")
args = parser.parse_args()

if args.role == "controller":
    bridge = LowCmdBridge(args.controller, realism=args.realism, targets=args.targets)
    bridge.serve(args.interface, args.seconds)
    raise SystemExit

robot = LowCmdRobot("unitree_g1", realism=args.realism)
robot.push("torso_link", (10.0 * args.impulse, 0.0, 0.0), start=2.0, end=2.1)
if args.role == "robot":
    robot.serve(args.interface, args.seconds)
    print("stands" if robot.stands else "fell")
    raise SystemExit

bridge = LowCmdBridge(args.controller, robot.robot, realism=args.realism, targets=args.targets)
state = robot.state()
while robot.data.time < args.seconds:
    state = robot.step(bridge(state))
print(bridge.controller.name, "by targets" if args.targets else "by torques", end=" ")
print("stands" if robot.stands else "fell", f"after {args.seconds:g} s in {args.realism}")
