"""A copy of a robot's model that looks good: light, ground, sky. The original is not touched."""

import copy

import mujoco
import numpy as np

from poise.envs.robots.robot import Robot

TILE = 0.5  # [m] edge of a ground tile
TILES = ((226, 228, 230), (206, 209, 212))  # two pale greys
BODY = (0.50, 0.56, 0.63, 1.0)
SKY = (238, 242, 246)
LAMP = (-16.0, 66.0, 4.0)  # azimuth from the camera, elevation [deg]; distance to the robot [m]
SHADOWED = 4.0  # half width of the region with shadows, over the CoM height
FIELD_OF_VIEW = 30.0  # [deg], vertical


def looks(robot: Robot, width: int, height: int, azimuth: float) -> mujoco.MjModel:
    """A private copy of the robot's model for pictures of `width` × `height` pixels.

    The lamp hangs on the camera's side, of which `azimuth` [deg] is the direction from the robot.
    (On the other side the ground would have speckles where MuJoCo's shadow map ends.)
    """
    model = copy.copy(robot.model)
    picture, quality = model.vis.global_, model.vis.quality
    picture.offwidth, picture.offheight = width, height
    picture.fovy = FIELD_OF_VIEW
    quality.shadowsize, quality.offsamples = 2048, 4
    _show_bare_bodies(model)
    _paint(model)
    _ground(model, robot.ground_geom_id)
    _sky(model)
    _light(model, robot.root_body_id, azimuth + LAMP[0])
    model.vis.map.alpha = 0.5  # of the robot, where the viewer makes it transparent
    model.vis.map.shadowclip = SHADOWED * robot.height_com / model.stat.extent
    return model


def _show_bare_bodies(model: mujoco.MjModel) -> None:
    """Show the collision geometry of bodies whose visual geometry is absent."""
    for body in range(1, model.nbody):
        start = model.body_geomadr[body]
        groups = model.geom_group[start : start + model.body_geomnum[body]]
        if len(groups) and np.all(groups > 2):  # MuJoCo shows the groups 0 to 2
            groups[:] = 2


def _paint(model: mujoco.MjModel) -> None:
    """A robot that has one colour throughout gets one on which the overlays stand out."""
    of_robot = model.geom_bodyid > 0
    looks_like = np.column_stack([model.geom_matid, model.geom_rgba])[of_robot]
    if np.all(looks_like == looks_like[0]):
        model.geom_matid[of_robot] = -1
        model.geom_rgba[of_robot] = BODY


def _ground(model: mujoco.MjModel, geom: int) -> None:
    """Pale tiles without reflections, without an end."""
    model.geom_size[geom, :2] = 0.0  # infinite
    model.geom_rgba[geom] = 1.0
    material = model.geom_matid[geom]
    if material < 0:
        model.geom_rgba[geom, :3] = np.divide(TILES[0], 255)
        return
    model.mat_rgba[material] = 1.0
    model.mat_reflectance[material] = model.mat_specular[material] = 0.0
    texture = model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB]
    if texture >= 0 and model.tex_type[texture] == int(mujoco.mjtTexture.mjTEXTURE_2D):
        model.mat_texuniform[material] = 1
        model.mat_texrepeat[material] = 0.5 / TILE  # a texture is two tiles wide
        pixels = _pixels(model, texture)
        rows, columns = np.indices(pixels.shape[:2])
        odd = (2 * rows // pixels.shape[0] + 2 * columns // pixels.shape[1]) % 2
        pixels[:, :, :3] = np.array(TILES)[odd]


def _sky(model: mujoco.MjModel) -> None:
    for texture in range(model.ntex):
        if model.tex_type[texture] == int(mujoco.mjtTexture.mjTEXTURE_SKYBOX):
            _pixels(model, texture)[:, :, :3] = SKY
    model.vis.rgba.haze[:] = [*np.divide(SKY, 255), 1.0]
    model.vis.map.haze = 0.4


def _pixels(model: mujoco.MjModel, texture: int) -> np.ndarray:
    """A texture's pixels (height, width, channels), a view."""
    shape = [model.tex_height[texture], model.tex_width[texture], model.tex_nchannel[texture]]
    start = model.tex_adr[texture]
    return model.tex_data[start : start + int(np.prod(shape))].reshape(shape)


def _light(model: mujoco.MjModel, body: int, azimuth: float) -> None:
    """One lamp that stays above the body and throws a shadow, and light from the camera."""
    a, e = np.radians([azimuth, LAMP[1]])
    to_lamp = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    head = model.vis.headlight
    head.ambient[:], head.diffuse[:], head.specular[:] = 0.45, 0.25, 0.05
    model.light_active[1:] = 0
    for lamp in range(min(model.nlight, 1)):
        model.light_type[lamp] = int(mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
        model.light_castshadow[lamp] = 1
        model.light_mode[lamp] = int(mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM)
        model.light_bodyid[lamp] = body
        model.light_poscom0[lamp] = LAMP[2] * to_lamp
        model.light_dir0[lamp] = -to_lamp
        model.light_ambient[lamp], model.light_diffuse[lamp] = 0.1, 0.4
        model.light_specular[lamp] = 0.1
