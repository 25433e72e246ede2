"""Rendered images: projection by the calibration, light and shadow by the sun."""

import numpy as np
from numpy.typing import NDArray

from intervis.camera import Camera
from intervis.drives.kitti_writer import START
from intervis.lab.worlds import shapes
from intervis.lab.worlds.renderer import pixel_rays, render
from intervis.lab.worlds.sensor_rig import SensorRig
from intervis.lab.worlds.triangles import Material, Triangles
from intervis.lab.worlds.world import World
from intervis.transform import inverse, transform

RED = Material("sign", (0.9, 0.0, 0.0), 0.5)
GREY = Material("kerb", (0.4, 0.4, 0.4), 0.5)


def numbers_of(text: str, key: str) -> NDArray[np.float64]:
    """One line of a calibration file, read without the project's reader."""
    line = next(line for line in text.splitlines() if line.startswith(f"{key}:"))
    return np.array([float(part) for part in line.split(":")[1].split()])


def written() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """P_rect_02 and cam_from_velo of the written files."""
    files = SensorRig().calibration_files(START)
    cameras, velo = files["calib_cam_to_cam.txt"], files["calib_velo_to_cam.txt"]
    cam0_from_velo = np.eye(4)
    cam0_from_velo[:3, :3] = numbers_of(velo, "R").reshape(3, 3)
    cam0_from_velo[:3, 3] = numbers_of(velo, "T")
    rectify = np.eye(4)
    rectify[:3, :3] = numbers_of(cameras, "R_rect_00").reshape(3, 3)
    return numbers_of(cameras, "P_rect_02").reshape(3, 4), rectify @ cam0_from_velo


def test_written_calibration_is_the_one_used() -> None:
    rig = SensorRig()
    projection, cam_from_velo = written()
    np.testing.assert_array_equal(projection, rig.camera().projection)
    np.testing.assert_allclose(cam_from_velo, rig.cam_from_velo, rtol=0, atol=1e-15)
    size = numbers_of(rig.calibration_files(START)["calib_cam_to_cam.txt"], "S_rect_02")
    assert size.tolist() == [1242.0, 375.0]
    assert rig.camera().fx_px == 721.5377
    rotation = cam_from_velo[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-11)


def test_a_triangle_is_painted_where_it_projects() -> None:
    """Corners projected with the written calibration; pixels coloured by the renderer."""
    corners_velo = np.array([[14.0, 3.0, 0.8], [17.0, -4.0, -0.9], [12.0, -1.0, 1.3]])
    projection, cam_from_velo = written()
    pose = np.eye(4)
    pose[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    pose[:3, 3] = [7.0, -3.0, 2.0]
    world = World(Triangles.of(transform(pose, corners_velo)[None], RED), (), lambda time_s: pose)
    picture = render(world.at(0.0), SensorRig().camera(), SensorRig().cam_from_velo, pose)
    red = (picture[..., 0] > 120) & (picture[..., 1] < 90)
    points_cam = corners_velo @ cam_from_velo[:3, :3].T + cam_from_velo[:3, 3]
    pixels = points_cam @ projection[:, :3].T + projection[:, 3]
    corners_px = pixels[:, :2] / pixels[:, 2:]
    rows, columns = np.indices(red.shape)
    places = np.stack([columns, rows], axis=-1).astype(float)
    depths = []
    for start, end in zip(corners_px, np.roll(corners_px, -1, axis=0), strict=True):
        way = (end - start) / np.linalg.norm(end - start)
        depths.append((places - start) @ [-way[1], way[0]])
    turn = np.sign(np.mean([depth[red].mean() for depth in depths]))
    inside_px = turn * np.min(turn * np.array(depths), axis=0)
    assert red.sum() > 3000
    assert red[turn * inside_px > 0.75].all()
    assert not red[turn * inside_px < -0.75].any()


def test_pixel_rays_invert_the_projection(rng) -> None:
    camera, cam_from_velo = SensorRig().camera(), SensorRig().cam_from_velo
    columns, rows = rng.uniform(0, 1242, 200), rng.uniform(0, 375, 200)
    centre, directions = pixel_rays(camera, inverse(cam_from_velo), columns, rows)
    points = centre + directions * rng.uniform(2, 90, (200, 1))
    pixels = transform(cam_from_velo, points) @ camera.projection[:, :3].T
    pixels += camera.projection[:, 3]
    np.testing.assert_allclose(pixels[:, 0] / pixels[:, 2], columns, atol=1e-6)
    np.testing.assert_allclose(pixels[:, 1] / pixels[:, 2], rows, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)


def test_sky_above_ground_below_shadow_beside() -> None:
    camera = Camera(np.array([[150.0, 0, 100, 0], [0, 150, 60, 0], [0, 0, 1, 0]]), 200, 120)
    cam_from_velo = np.eye(4)
    cam_from_velo[:3, :3] = [[0, -1, 0], [0, 0, -1], [1, 0, 0]]
    ground = shapes.quad([-99, -99, -2], [99, -99, -2], [99, 99, -2], [-99, 99, -2])
    block = shapes.box([9.0, -1.0, -2.0], [11.0, 1.0, 1.0])
    world = World(Triangles.of(np.concatenate([ground, block]), GREY), (), lambda time_s: np.eye(4))
    # The sun is at 45 degrees on the left: the shadow of the 3 m block is 3 m long, to the right.
    sun = (0.0, 1.0, 1.0)
    picture = render(world.at(0.0), camera, cam_from_velo, np.eye(4), sun).astype(float)
    sky = picture[2, 5]
    assert sky[2] > sky[0] + 20  # blue

    def brightness(place: tuple[float, float, float]) -> float:
        x, y, z = place
        column, row = round(100 - 150 * y / x), round(60 - 150 * z / x)
        return float(picture[row - 1 : row + 2, column - 1 : column + 2].mean())

    lit, shaded = brightness((10.0, 3.0, -2.0)), brightness((10.0, -2.5, -2.0))
    beyond = brightness((10.0, -4.6, -2.0))
    assert shaded < 0.75 * lit
    assert beyond > 0.9 * lit


def test_picture_of_the_street_shows_many_surfaces_and_repeats(street, street_snapshot) -> None:
    rig, pose = SensorRig(), street.vehicle_pose_at(0.7)
    camera = Camera(rig.camera().projection / [[3], [3], [1]], 414, 125)
    picture = render(street_snapshot, camera, rig.cam_from_velo, pose)
    again = render(street_snapshot, camera, rig.cam_from_velo, pose)
    assert picture.shape == (125, 414, 3)
    assert picture.dtype == np.uint8
    np.testing.assert_array_equal(picture, again)
    assert 90 < picture.mean() < 190
    assert picture.std() > 35
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 1000
