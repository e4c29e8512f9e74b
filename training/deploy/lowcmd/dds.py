"""LowState and LowCmd over the network, by Unitree's own package; alone imports unitree_sdk2py."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from poise.configs.errors import ConfigError

from .messages import PERIOD, SLOTS, checksum

if TYPE_CHECKING:
    from .bridge import LowCmdBridge
    from .simulated import LowCmdRobot

INSTALL = "pip install git+https://github.com/unitreerobotics/unitree_sdk2_python"
SILENT = 5.0  # [s] without a LowState after which a controller gives up


def control(bridge: LowCmdBridge, interface: str, seconds: float) -> None:
    """As `LowCmdBridge.serve`."""
    sdk = _sdk(interface)
    heard: list[Any] = []
    subscriber = sdk.ChannelSubscriber("rt/lowstate", sdk.LowState_)
    subscriber.Init(heard.append, 10)
    publisher = sdk.ChannelPublisher("rt/lowcmd", sdk.LowCmd_)
    publisher.Init()
    bridge.make = sdk.make_cmd
    last = time.monotonic()
    ends = last + seconds
    while time.monotonic() < ends:
        if heard:
            state, last = heard.pop(0), time.monotonic()
            publisher.Write(bridge(state))
        elif time.monotonic() - last > SILENT:
            raise ConfigError(f"no LowState for {SILENT:g} s", source="rt/lowstate",
                              field="interface")  # fmt: skip
        else:
            time.sleep(0.1 * PERIOD)


def simulate_over_dds(robot: LowCmdRobot, interface: str, seconds: float) -> None:
    """As `LowCmdRobot.serve`."""
    sdk = _sdk(interface)
    latest: list[Any] = []
    subscriber = sdk.ChannelSubscriber("rt/lowcmd", sdk.LowCmd_)
    subscriber.Init(lambda cmd: latest.append(cmd) if checksum(cmd) == cmd.crc else None, 10)
    publisher = sdk.ChannelPublisher("rt/lowstate", sdk.LowState_)
    publisher.Init()
    message, following = sdk.make_state(), time.monotonic()
    while robot.data.time < seconds:
        state = robot.step(latest[-1]) if latest else robot.state()
        del latest[:-1]
        message.tick, message.mode_machine = state.tick, state.mode_machine
        for name in ("quaternion", "gyroscope", "accelerometer"):
            setattr(message.imu_state, name, getattr(state.imu_state, name))
        for k in range(SLOTS):
            mine, theirs = state.motor_state[k], message.motor_state[k]
            theirs.q, theirs.dq, theirs.tau_est = mine.q, mine.dq, mine.tau_est
        publisher.Write(message)
        following += PERIOD
        time.sleep(max(following - time.monotonic(), 0.0))


class _Sdk:
    """What is used of Unitree's package."""

    def __init__(self) -> None:
        from unitree_sdk2py.core import channel
        from unitree_sdk2py.idl import default
        from unitree_sdk2py.idl.unitree_hg.msg.dds_ import LowCmd_, LowState_

        self.LowCmd_, self.LowState_ = LowCmd_, LowState_
        self.make_cmd = default.unitree_hg_msg_dds__LowCmd_
        self.make_state = default.unitree_hg_msg_dds__LowState_
        self.ChannelPublisher = channel.ChannelPublisher
        self.ChannelSubscriber = channel.ChannelSubscriber
        self.initialize = channel.ChannelFactoryInitialize


def _sdk(interface: str) -> _Sdk:
    try:
        sdk = _Sdk()
    except ImportError as error:
        raise ConfigError(f"needs Unitree's package ({error}): {INSTALL}", source="unitree_sdk2py",
                          field="interface") from None  # fmt: skip
    sdk.initialize(0, interface)
    return sdk
