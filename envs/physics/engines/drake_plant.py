"""A robot in Drake, made from the arrays of its MuJoCo model."""

import logging
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np
from pydrake.geometry import (
    Box,
    Capsule,
    CollisionFilterDeclaration,
    Convex,
    Cylinder,
    Ellipsoid,
    GeometrySet,
    HalfSpace,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlant,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    JointActuator,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
    WeldJoint,
)
from pydrake.systems.framework import DiagramBuilder

from poise.configs.errors import ConfigError
from poise.envs.robots.ground import pair_friction
from poise.envs.robots.robot import Robot

from .config import Physics
from .drake_limits import LimitDampers
from .geometry import GEOM, ground_points, mesh_vertices, rotation_of, touching_pairs
from .limits import LimitForces

POINT = 1e-6  # [m] radius of a ball that stands for a corner
SLIPPERY, ROUGH = 1e-9, 1e9  # friction: Drake takes the harmonic mean, 2 μ₁ μ₂/(μ₁ + μ₂)


class DrakePlant:
    """A robot on level ground, and where its coordinates are in MuJoCo's.

    Bodies, inertias, joints, armature (as rotor inertia) and damping are those of the model;
    springs, dry friction and gravity compensation are forces of the caller, who names the limits
    that joints are beyond (`step`). The ground bears points (`ground_points`) whose friction is
    that of MuJoCo's pair, by a circular cone; bodies touch each other by their shapes. Joints of
    one body are chained by bodies without mass.

    Attributes:
        plant, context: Drake's plant, and its part of a diagram's context.
        qpos, qvel: (nj,) of each joint its index in Drake's positions and velocities.
        bodies: Drake's body index → MuJoCo's.
    """

    def __init__(self, robot: Robot, physics: Physics, softer: np.ndarray,
                 apart: Collection[int] = ()):  # fmt: skip
        """`softer` (ngeom,): by how much the contacts of each geom are softer than its model's;
        geoms `apart` do not touch the ground."""
        self.robot, model = robot, robot.model
        self._apart = apart
        self._stiffness = 2.0 * robot.mass * robot.units.gravity / physics.sink
        self._relaxation, self._softer = physics.relaxation, softer
        self._dissipation = float(physics.dissipation)
        builder = DiagramBuilder()
        config = MultibodyPlantConfig()
        config.time_step = float(model.opt.timestep) / physics.substeps
        config.discrete_contact_approximation = physics.contact
        config.stiction_tolerance = physics.slip
        config.contact_model = "point"
        config.use_sampled_output_ports = False  # forces of the step that begins, not of the last
        config.adjacent_bodies_collision_filters = False  # the pairs are MuJoCo's
        self.plant, self._scene = AddMultibodyPlant(config, builder)
        self.bodies: dict[int, int] = {}
        self._links: dict[int, RigidBody] = {0: self.plant.world_body()}
        self._joints: list[Any] = []
        self._rotors: dict[int, JointActuator] = {}  # of joints with armature, or limits
        for body in range(1, model.nbody):
            self._add_body(body)
        self._add_ground()
        gravity = self.plant.mutable_gravity_field()
        gravity.set_gravity_vector(np.array(model.opt.gravity))
        with _silenced("drake"):  # it warns that a half space does not touch what is deformable
            self.plant.Finalize()
            self._filter()
            self.diagram = builder.Build()
            self.diagram_context = self.diagram.CreateDefaultContext()
        self.context = self.plant.GetMyMutableContextFromRoot(self.diagram_context)
        self._index()

    def _index(self) -> None:
        plant: MultibodyPlant = self.plant
        root = self._links[self.robot.root_body_id]
        self._root = root.floating_positions_start()
        self._root_v = root.floating_velocities_start_in_v()
        self.qpos = np.array([joint.position_start() for joint in self._joints], dtype=int)
        self.qvel = np.array([joint.velocity_start() for joint in self._joints], dtype=int)
        self._reference = self.robot.model.qpos0[7:].copy()
        self._force_port = plant.get_applied_generalized_force_input_port()
        self._given = self._force_port.FixValue(self.context, np.zeros(plant.num_velocities()))
        self._limits = LimitDampers(plant, self.context, self._rotors, self.qvel)
        self._results = plant.get_contact_results_output_port()

    def _add_body(self, body: int) -> None:
        """A body of the model and the joints that carry it, in their order."""
        model, plant = self.robot.model, self.plant
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or f"body{body}"
        link = plant.AddRigidBody(f"{name}/body{body}", self._inertia(body, name))
        self._links[body], self.bodies[int(link.index())] = link, body
        parent = self._links[int(model.body_parentid[body])]
        place = _transform(model.body_pos[body], model.body_quat[body])
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        if count == 0:
            plant.AddJoint(WeldJoint(f"weld/{body}", parent.body_frame(), link.body_frame(), place))
            return
        if first == 0:  # the free joint
            return
        for joint in range(first, first + count):
            child = link
            if joint < first + count - 1:
                child = plant.AddRigidBody(f"{name}/joint{joint}", SpatialInertia.Zero())
            self._add_joint(joint, parent, place, child)
            parent, place = child, RigidTransform()

    def _add_joint(
        self, joint: int, parent: RigidBody, place: RigidTransform, child: RigidBody
    ) -> None:
        model, plant = self.robot.model, self.plant
        axis, dof = np.array(model.jnt_axis[joint]), int(model.jnt_dofadr[joint])
        at = RigidTransform(np.array(model.jnt_pos[joint]))
        outer = plant.AddFrame(FixedOffsetFrame(f"outer{joint}", parent.body_frame(), place @ at))
        inner = plant.AddFrame(FixedOffsetFrame(f"inner{joint}", child.body_frame(), at))
        hinge = model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_HINGE)
        kind = RevoluteJoint if hinge else PrismaticJoint
        made = plant.AddJoint(
            kind(f"joint{joint}", outer, inner, axis, float(model.dof_damping[dof]))
        )
        self._joints.append(made)
        if model.dof_armature[dof] > 0.0 or model.jnt_limited[joint]:
            rotor = plant.AddJointActuator(f"rotor{joint}", made)
            rotor.set_default_gear_ratio(1.0)
            rotor.set_default_rotor_inertia(float(model.dof_armature[dof]))
            self._rotors[joint - 1] = rotor

    def _inertia(self, body: int, name: str) -> SpatialInertia:
        """About the body's origin, from the principal axes that MuJoCo keeps."""
        model = self.robot.model
        if model.body_mass[body] == 0.0:
            return SpatialInertia.Zero()
        axes = rotation_of(model.body_iquat[body])
        own = axes @ np.diag(model.body_inertia[body]) @ axes.T
        moments = RotationalInertia(*own[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
        try:
            return SpatialInertia.MakeFromCentralInertia(
                float(model.body_mass[body]), np.array(model.body_ipos[body]), moments
            )
        except RuntimeError as error:
            said = str(error).splitlines()[0]
            raise ConfigError(f"drake does not hold the inertia of the body {name!r}: {said}",
                              source=self.robot.name, field="physics") from None  # fmt: skip

    def _add_ground(self) -> None:
        plant, model = self.plant, self.robot.model
        material = self._material(ROUGH, None)
        self._ground = plant.RegisterCollisionGeometry(
            plant.world_body(), RigidTransform(), HalfSpace(), "ground", material
        )
        self._points, self._shapes = [], {}
        for each in ground_points(self.robot):
            if each.geom in self._apart:
                continue
            link = self._links[int(model.geom_bodyid[each.geom])]
            # half of the mean with something very rough is the coefficient itself
            material = self._material(max(0.5 * each.friction, SLIPPERY), each.geom)
            for k, point in enumerate(each.points):
                self._points.append(
                    plant.RegisterCollisionGeometry(
                        link, RigidTransform(point), Sphere(each.radius or POINT),
                        f"point{each.geom}/{k}", material,
                    )
                )  # fmt: skip
        self._pairs = touching_pairs(self.robot)
        for geom in sorted({geom for pair in self._pairs for geom in pair}):
            material = self._material(pair_friction(model, geom, geom), geom)
            self._shapes[geom] = plant.RegisterCollisionGeometry(
                self._links[int(model.geom_bodyid[geom])],
                _transform(model.geom_pos[geom], model.geom_quat[geom]),
                _shape(model, geom), f"shape{geom}", material,
            )  # fmt: skip

    def _material(self, friction: float, geom: int | None) -> ProximityProperties:
        """The material of a geom, or of the ground: None.

        The stiffness of a contact is k₁ k₂/(k₁ + k₂), its dissipation (d₁ k₂ + d₂ k₁)/(k₁ + k₂),
        its relaxation time τ₁ + τ₂: the ground has none, two geoms have both.
        """
        stiffness = self._stiffness / (1.0 if geom is None else self._softer[geom] ** 2)
        properties = ProximityProperties()
        properties.AddProperty("material", "coulomb_friction", CoulombFriction(friction, friction))
        properties.AddProperty("material", "point_contact_stiffness", stiffness)
        relaxation = 0.0 if geom is None else self._relaxation
        properties.AddProperty("material", "relaxation_time", relaxation)
        properties.AddProperty("material", "hunt_crossley_dissipation", self._dissipation)
        return properties

    def _filter(self) -> None:
        """Let points touch the ground alone, and shapes those that MuJoCo lets them."""
        points, shapes = GeometrySet(self._points), GeometrySet(list(self._shapes.values()))
        ground = GeometrySet([self._ground])
        rules = CollisionFilterDeclaration()
        rules.ExcludeWithin(points)
        rules.ExcludeBetween(points, shapes)
        rules.ExcludeBetween(ground, shapes)
        allowed, geoms = set(self._pairs), sorted(self._shapes)
        for k, a in enumerate(geoms):
            others = [self._shapes[b] for b in geoms[k + 1 :] if (a, b) not in allowed]
            if others:
                rules.ExcludeBetween(GeometrySet([self._shapes[a]]), GeometrySet(others))
        self._scene.collision_filter_manager().Apply(rules)

    def write(self, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Take MuJoCo's state (nq,), (nv,)."""
        self.plant.SetPositionsAndVelocities(
            self.context, np.concatenate([self._positions(qpos), self._velocities(qpos, qvel)])
        )

    def _positions(self, qpos: np.ndarray) -> np.ndarray:
        q = np.zeros(self.plant.num_positions())
        q[self._root : self._root + 4] = qpos[3:7]
        q[self._root + 4 : self._root + 7] = qpos[:3]
        q[self.qpos] = qpos[7:] - self._reference
        return q

    def _velocities(self, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        return self.to_drake(rotation_of(qpos[3:7]), qvel)

    def to_drake(self, root_axes: np.ndarray, vector: np.ndarray) -> np.ndarray:
        """Velocities, or generalised forces, (nv,) in Drake's order and axes of the root."""
        v, k = np.zeros(self.plant.num_velocities()), self._root_v
        v[k : k + 3] = root_axes @ vector[3:6]
        v[k + 3 : k + 6] = vector[:3]
        v[self.qvel] = vector[6:]
        return v

    def step(self, forces: np.ndarray, beyond: LimitForces | None = None) -> np.ndarray:
        """Drake's positions and velocities after a step with generalised forces, in its order, and
        those of limits that push."""
        self._given.GetMutableData().get_mutable_value().SetFromVector(forces)
        return self._limits.step(beyond)

    def read(self, values: np.ndarray, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Write what `step` returned into MuJoCo's state."""
        count, k = self.plant.num_positions(), self._root
        q, v = values[:count], values[count:]
        qpos[:3], qpos[3:7] = q[k + 4 : k + 7], q[k : k + 4]
        mujoco.mju_normalize4(qpos[3:7])
        qpos[7:] = q[self.qpos] + self._reference
        n = self._root_v
        qvel[:3], qvel[3:6] = v[n + 3 : n + 6], rotation_of(qpos[3:7]).T @ v[n : n + 3]
        qvel[6:] = v[self.qvel]

    def contacts(self) -> tuple[np.ndarray, list[int]]:
        """The wrench (6,) of the ground about the world's origin [N, N·m] in the step that begins,
        and the body of every contact with it."""
        results, wrench, bodies = self._results.Eval(self.context), np.zeros(6), []
        for i in range(results.num_point_pair_contacts()):
            contact = results.point_pair_contact_info(i)
            a, b = int(contact.bodyA_index()), int(contact.bodyB_index())
            if 0 not in (a, b):
                continue
            force = contact.contact_force() if a == 0 else -contact.contact_force()
            x, y, z = contact.contact_point()
            wrench += (*force, y * force[2] - z * force[1], z * force[0] - x * force[2],
                       x * force[1] - y * force[0])  # fmt: skip
            bodies.append(self.bodies[b or a])
        return wrench, bodies


@contextmanager
def _silenced(logger: str) -> Iterator[None]:
    known = logging.getLogger(logger)
    level = known.level
    known.setLevel(logging.ERROR)
    try:
        yield
    finally:
        known.setLevel(level)


def _transform(position: np.ndarray, quaternion: np.ndarray) -> RigidTransform:
    return RigidTransform(RotationMatrix(rotation_of(quaternion)), np.array(position))


def _shape(model: mujoco.MjModel, geom: int) -> Any:
    size, kind = model.geom_size[geom], GEOM(int(model.geom_type[geom]))
    if kind == GEOM.mjGEOM_SPHERE:
        return Sphere(size[0])
    if kind == GEOM.mjGEOM_CAPSULE:
        return Capsule(size[0], 2.0 * size[1])
    if kind == GEOM.mjGEOM_BOX:
        return Box(2.0 * np.array(size))
    if kind == GEOM.mjGEOM_CYLINDER:
        return Cylinder(size[0], 2.0 * size[1])
    if kind == GEOM.mjGEOM_ELLIPSOID:
        return Ellipsoid(np.array(size))
    return Convex(mesh_vertices(model, geom).T, f"mesh{geom}")
