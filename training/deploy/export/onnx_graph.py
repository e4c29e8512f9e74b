"""A policy as an ONNX graph: raw observations in, actions out."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from poise.envs.robots.mirror import Mirror
from poise.training.learning.policy import Policy

OPSET, IR = 17, 8  # what runtimes of 2022 read
INPUT, OUTPUT = "obs", "actions"  # the names that mjlab and rsl_rl give them
NAME = "policy"


def onnx_bytes(policy: Policy, metadata: Mapping[str, str]) -> bytes:
    """Return the file of `policy` with these metadata; the same policy gives the same bytes.

    `obs` (n, no) float32 are observations as the environment gives them, `actions` (n, na) float32
    are those of `Policy.predict`: the normalisation, both sides of a symmetric policy and the
    limits of the action are part of the graph. In between it computes with 64 bits, as `predict`
    does. Weights are stored with 32 bits where these hold them exactly.
    """
    import onnx

    graph = _Graph()
    graph.add_policy(policy)
    ends = [
        onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, ["n", size])
        for name, size in (
            (INPUT, len(policy.mean)),
            (OUTPUT, policy.layers[-1][0].shape[1]),
        )
    ]
    made = onnx.helper.make_graph(graph.nodes, NAME, ends[:1], ends[1:], graph.tensors)
    opset = [onnx.helper.make_opsetid("", OPSET)]
    model = onnx.helper.make_model(made, opset_imports=opset, ir_version=IR)
    model.producer_name = "poise"
    for key, value in metadata.items():
        model.metadata_props.add(key=key, value=value)
    onnx.checker.check_model(model, full_check=True)
    return bytes(model.SerializeToString(deterministic=True))


class _Graph:
    """Nodes and tensors, added one after the other; an edge is the name of its values."""

    def __init__(self) -> None:
        import onnx

        self.onnx = onnx
        self.nodes: list[Any] = []
        self.tensors: list[Any] = []

    def add_policy(self, policy: Policy) -> None:
        """What `Policy.predict` computes, from `INPUT` to `OUTPUT`."""
        shift, scale = self.array("mean", policy.mean), self.array("scale", policy.scale)
        *hidden, last = [
            (self.array(f"layer{i}.weight", weight), self.array(f"layer{i}.bias", bias))
            for i, (weight, bias) in enumerate(policy.layers)
        ]
        activate = {"tanh": self.tanh, "elu": self.elu}[policy.config.ppo.activation]

        def mean(observation: str) -> str:
            """The mean action, before its limits; a symmetric policy passes the layers twice."""
            x = self.op("Mul", self.op("Sub", observation, shift), scale)
            x = self.op("Clip", x, self.number(-policy.clip), self.number(policy.clip))
            for weight, bias in hidden:
                x = activate(self.op("Gemm", x, weight, bias))
            return self.op("Gemm", x, *last)

        seen = self.wide(INPUT)
        action = mean(seen)
        if policy.mirrors is not None:
            see, do = policy.mirrors
            image = self.mirror(do, mean(self.mirror(see, seen, "see")), "do")
            action = self.op("Mul", self.op("Add", action, image), self.number(0.5))
        action = self.op("Clip", action, self.number(-1.0), self.number(1.0))
        self.op("Cast", action, to=self.onnx.TensorProto.FLOAT, output=OUTPUT)

    def op(self, kind: str, *inputs: str, output: str = "", **attributes: Any) -> str:
        """Add a node; returns the name of its values."""
        output = output or f"x{len(self.nodes)}"
        self.nodes.append(self.onnx.helper.make_node(kind, inputs, [output], **attributes))
        return output

    def array(self, name: str, values: np.ndarray) -> str:
        """Add an array; returns the name of its values, which have 64 bits."""
        stored = narrowed(values)
        self.tensors.append(self.onnx.numpy_helper.from_array(stored, name))
        return name if stored.dtype == values.dtype else self.wide(name)

    def wide(self, name: str) -> str:
        """Values of 32 bits with 64."""
        return self.op("Cast", name, to=self.onnx.TensorProto.DOUBLE)

    def number(self, value: float) -> str:
        """Add a number, unless it is there."""
        name = f"number {value:g}"
        if name not in [tensor.name for tensor in self.tensors]:
            self.tensors.append(self.onnx.numpy_helper.from_array(np.array(value), name))
        return name

    def mirror(self, mirror: Mirror, values: str, name: str) -> str:
        """Return the image that `mirror` makes of `values`."""
        order = self.onnx.numpy_helper.from_array(mirror.order.astype(np.int64), f"{name}.order")
        self.tensors.append(order)
        picked = self.op("Gather", values, order.name, axis=1)
        return self.op("Mul", picked, self.array(f"{name}.sign", mirror.sign))

    def tanh(self, x: str) -> str:
        return self.op("Tanh", x)

    def elu(self, x: str) -> str:
        """max(x, 0) + exp(min(x, 0)) − 1: runtimes have Elu with 32 bits only."""
        below = self.op("Exp", self.op("Min", x, self.number(0.0)))
        below = self.op("Sub", below, self.number(1.0))
        return self.op("Add", self.op("Max", x, self.number(0.0)), below)


def narrowed(values: np.ndarray) -> np.ndarray:
    """Return the values with 32 bits if these hold them exactly; else as they are."""
    short = values.astype(np.float32)
    return short if np.array_equal(short.astype(values.dtype), values) else values
