"""Unitree's messages of the G1 and H1-2, field by field, and their checksum.

Objects of `unitree_sdk2py` have the same fields: what takes one takes the other.
"""

import struct
import zlib
from dataclasses import dataclass, field
from typing import Any

SLOTS = 35  # motors of a message, whatever the robot has
PERIOD = 0.002  # [s] between two messages
_CMD = struct.Struct("<2B2x" + "B3x5fI" * SLOTS + "4I")
#: bytes with their bits in reverse: the checksum takes the highest first, zlib's the lowest
_MIRROR = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


@dataclass
class MotorCmd:
    """τ = `tau` + `kp` (`q` − q) + `kd` (`dq` − q̇) [N·m, rad, rad/s]; `mode` 1 enables."""

    mode: int = 0
    q: float = 0.0
    dq: float = 0.0
    tau: float = 0.0
    kp: float = 0.0
    kd: float = 0.0
    reserve: int = 0


@dataclass
class LowCmd:
    """`unitree_hg.msg.dds_.LowCmd_`: `mode_pr` 0 commands ankles by pitch and roll, and
    `mode_machine` is that of the robot's LowState."""

    mode_pr: int = 0
    mode_machine: int = 0
    motor_cmd: list[MotorCmd] = field(default_factory=lambda: [MotorCmd() for _ in range(SLOTS)])
    reserve: list[int] = field(default_factory=lambda: [0] * 4)
    crc: int = 0


@dataclass
class IMUState:
    """Quaternion w first, gyroscope [rad/s], accelerometer [m/s²] in the axes of the pelvis."""

    quaternion: list[float] = field(default_factory=lambda: [1.0, 0.0, 0.0, 0.0])
    gyroscope: list[float] = field(default_factory=lambda: [0.0] * 3)
    accelerometer: list[float] = field(default_factory=lambda: [0.0, 0.0, 9.81])


@dataclass
class MotorState:
    """Position [rad], velocity [rad/s] and estimated torque [N·m] of a motor."""

    q: float = 0.0
    dq: float = 0.0
    tau_est: float = 0.0


@dataclass
class LowState:
    """The fields of `unitree_hg.msg.dds_.LowState_` that a controller reads; `tick` [ms]."""

    mode_machine: int = 0
    tick: int = 0
    imu_state: IMUState = field(default_factory=IMUState)
    motor_state: list[MotorState] = field(
        default_factory=lambda: [MotorState() for _ in range(SLOTS)]
    )


def checksum(cmd: Any) -> int:
    """The `crc` of a LowCmd: CRC-32/MPEG-2 over its words, the highest byte first."""
    motors = [value for m in cmd.motor_cmd
              for value in (m.mode, m.q, m.dq, m.tau, m.kp, m.kd, m.reserve)]  # fmt: skip
    packed = _CMD.pack(cmd.mode_pr, cmd.mode_machine, *motors, *cmd.reserve)
    words = struct.unpack(f"<{len(packed) // 4}I", packed)
    return mpeg2(struct.pack(f">{len(words)}I", *words))


def mpeg2(data: bytes) -> int:
    """CRC-32/MPEG-2: polynomial 04c11db7, from ffffffff, nothing reflected."""
    mirrored = zlib.crc32(data.translate(_MIRROR)) ^ 0xFFFFFFFF
    return int(f"{mirrored:032b}"[::-1], 2)
