"""Files of masks read back by each benchmark's conventions (`mask_readers`)."""

from dataclasses import replace

import mask_readers as readers
import numpy as np
import pytest

from intervis.camera import Camera
from intervis.errors import OutputError
from intervis.transform import rigid
from intervis.uses.voxels.camera_voxels import PosedCamera
from intervis.uses.voxels.mask_layouts import LAYOUTS, FrameName, layout_named
from intervis.uses.voxels.mask_record import write_frame
from intervis.uses.voxels.masks import Masks
from intervis.uses.voxels.voxel_grid import VoxelGrid

SHAPE = (8, 6, 4)
NAME = FrameName("drive_1", 7, "sweep.pcd.bin")


def made_masks(labels: bool = True) -> Masks:
    """Masks of random voxels, different for each array."""
    rng = np.random.default_rng(3)
    state = rng.integers(0, 4, SHAPE).astype(np.uint8)
    occupied = state == 1
    label = np.where(occupied, rng.integers(0, 17, SHAPE), 0).astype(np.uint16)
    return Masks(
        VoxelGrid([0, 0, 0], 0.5, SHAPE),
        "exact",
        input=rng.random(SHAPE) < 0.3,
        occupied=occupied,
        free=state == 0,
        occluded=rng.random(SHAPE) < 0.5,
        invalid=rng.random(SHAPE) < 0.5,
        state=state,
        label=label if labels else None,
        lidar={"top": rng.random(SHAPE) < 0.5},
        camera={"front": rng.random(SHAPE) < 0.4, "back": rng.random(SHAPE) < 0.4},
        probability=rng.random(SHAPE).astype(np.float32),
        posed={"front": camera_ahead()},
    )


def camera_ahead() -> PosedCamera:
    """A camera at (0, 1.3, 1) m that looks along x; 90 degrees wide, 60 high."""
    axes = [[0, -1, 0], [0, 0, -1], [1, 0, 0]]
    projection = np.array([[50.0, 0, 50, 0], [0, 50, 29, 0], [0, 0, 1, 0]])
    cam_from_grid = rigid(axes, np.negative(axes) @ [0.0, 1.3, 1.0])
    return PosedCamera(Camera(projection, 100, 58), cam_from_grid)


def files_of(tmp_path, layout: str, masks: Masks) -> dict:
    contents = layout_named(layout).write(NAME, masks)
    write_frame(tmp_path, NAME.number, "made from this", contents)
    return {name: tmp_path / name for name in contents}


def test_semantickitti(tmp_path) -> None:
    masks = made_masks()
    files = files_of(tmp_path, "semantickitti", masks)
    stem = "voxels/000007"
    assert set(files) == {f"{stem}.{end}" for end in ("bin", "label", "occluded", "invalid")}
    for ending, mask in (
        ("bin", masks.input),
        ("occluded", masks.occluded),
        ("invalid", masks.invalid),
    ):
        read = readers.semantickitti_volume(files[f"{stem}.{ending}"], SHAPE)
        np.testing.assert_array_equal(read, mask)
    label = readers.semantickitti_labels(files[f"{stem}.label"], SHAPE)
    np.testing.assert_array_equal(label, masks.label)


def test_semantickitti_without_labels(tmp_path) -> None:
    files = files_of(tmp_path, "semantickitti", made_masks(labels=False))
    assert not any(name.endswith(".label") for name in files)


def test_sscbench(tmp_path) -> None:
    masks = made_masks()
    nuscenes = files_of(tmp_path, "sscbench-nuscenes", masks)
    assert set(nuscenes) == {f"voxels/0007.{end}" for end in ("bin", "label", "invalid")}
    read = readers.semantickitti_volume(nuscenes["voxels/0007.invalid"], SHAPE)
    np.testing.assert_array_equal(read, masks.invalid)
    kitti_360 = files_of(tmp_path, "sscbench-kitti360", masks)
    read = readers.bytes_volume(kitti_360["voxels/000007.invalid"], SHAPE)
    np.testing.assert_array_equal(read, masks.invalid)
    read = readers.semantickitti_volume(kitti_360["voxels/000007.bin"], SHAPE)
    np.testing.assert_array_equal(read, masks.input)
    (path,) = files_of(tmp_path, "sscbench-waymo", masks).values()
    assert path.name == "007.npz"
    with np.load(path, allow_pickle=False) as arrays:
        assert set(arrays.files) == {"input", "labels", "invalid"}
        np.testing.assert_array_equal(arrays["invalid"], masks.invalid)
        np.testing.assert_array_equal(arrays["labels"], masks.label)


def test_occ3d(tmp_path) -> None:
    masks = made_masks()
    (name,) = files_of(tmp_path, "occ3d-nuscenes", masks)
    assert name == "gts/drive_1/000007/labels.npz"
    with np.load(tmp_path / name, allow_pickle=False) as arrays:
        assert {key: arrays[key].dtype.name for key in arrays.files} == {
            "semantics": "uint8",
            "mask_lidar": "uint8",
            "mask_camera": "uint8",
        }
        for voxel in np.ndindex(SHAPE):
            expected = masks.label[voxel] if masks.occupied[voxel] else 17
            assert arrays["semantics"][voxel] == expected
            assert arrays["mask_lidar"][voxel] == (masks.state[voxel] in (0, 1))
            seen = masks.camera["front"][voxel] or masks.camera["back"][voxel]
            assert arrays["mask_camera"][voxel] == seen


def test_occ3d_waymo(tmp_path) -> None:
    """Free is 23, as in the published files; infov is what the image shows or hides."""
    masks = made_masks()
    (name,) = files_of(tmp_path, "occ3d-waymo", masks)
    assert name == "drive_1/007_04.npz"
    with np.load(tmp_path / name, allow_pickle=False) as file:
        arrays = {key: file[key] for key in file.files}
    assert set(arrays) == {"voxel_label", "origin_voxel_state", "final_voxel_state", "infov"}
    assert arrays["voxel_label"].dtype == np.uint8
    for x, y, z in np.ndindex(SHAPE):
        voxel = x, y, z
        expected = masks.label[voxel] if masks.occupied[voxel] else 23
        assert arrays["voxel_label"][voxel] == expected
        assert arrays["origin_voxel_state"][voxel] == (masks.state[voxel] in (0, 1))
        seen = masks.camera["front"][voxel] or masks.camera["back"][voxel]
        assert arrays["final_voxel_state"][voxel] == seen
        ahead, right, down = 0.5 * x + 0.25, 1.3 - (0.5 * y + 0.25), 1 - (0.5 * z + 0.25)
        u, v = 50 * right / ahead + 50, 50 * down / ahead + 29
        assert arrays["infov"][voxel] == (0 <= u < 100 and 0 <= v < 58)
    assert 0 < arrays["infov"].mean() < 1


@pytest.mark.parametrize("with_cameras", [True, False])
def test_occnet(tmp_path, with_cameras) -> None:
    masks = made_masks()
    masks = masks if with_cameras else replace(masks, camera={})
    files = files_of(tmp_path, "occnet", masks)
    assert set(files) == {"drive_1/007_occ.npy", "drive_1/007_occ_invalid.npy"}
    rows = np.load(files["drive_1/007_occ.npy"], allow_pickle=False)
    invalid = np.load(files["drive_1/007_occ_invalid.npy"], allow_pickle=False)
    assert rows.dtype.kind == invalid.dtype.kind == "i"
    in_file = (SHAPE[1], SHAPE[0], SHAPE[2])
    volume = readers.nuscenes_axes(readers.flat_rows_volume(rows, in_file))
    np.testing.assert_array_equal(volume >= 0, masks.occupied)
    np.testing.assert_array_equal(volume[masks.occupied], masks.label[masks.occupied])
    hidden = np.zeros(in_file, bool)
    for index in invalid.tolist():
        hidden[readers.flat_place(index, in_file)] = True
    seen = masks.mask_camera if with_cameras else masks.mask_lidar
    np.testing.assert_array_equal(readers.nuscenes_axes(hidden), ~seen & ~masks.occupied)


@pytest.mark.realdata
def test_occ3d_is_written_as_the_published_file_is(shared_data, tmp_path) -> None:
    masks = made_masks()
    path = next(iter(files_of(tmp_path, "occ3d-nuscenes", masks).values()))
    grid = LAYOUTS["occ3d-nuscenes"].grid
    with np.load(shared_data / "occ3d" / "labels.npz") as published, np.load(path) as own:
        assert set(published.files) == set(own.files)
        for name in published.files:
            assert published[name].dtype == own[name].dtype
            assert published[name].shape == grid.shape
        assert published["semantics"].max() == own["semantics"].max() == 17


@pytest.mark.parametrize(
    ("layout", "rows_name", "order"),
    [
        ("surroundocc", "samples/sweep.pcd.bin.npy", "xyz"),
        ("openoccupancy", "scene_drive_1/occupancy/000007.npy", "zyx"),
    ],
)
def test_rows_of_occupied_voxels(tmp_path, layout, rows_name, order) -> None:
    masks = made_masks()
    files = files_of(tmp_path, layout, masks)
    rows = np.load(files[rows_name], allow_pickle=False)
    assert rows.dtype.kind == "i"
    in_file = (SHAPE[1], SHAPE[0], SHAPE[2])
    volume = readers.nuscenes_axes(readers.rows_volume(rows, in_file, order))
    np.testing.assert_array_equal(volume >= 0, masks.occupied)
    np.testing.assert_array_equal(volume[masks.occupied], masks.label[masks.occupied])
    (extra,) = [path for name, path in files.items() if name != rows_name]
    with np.load(extra, allow_pickle=False) as arrays:
        lidar = readers.nuscenes_axes(arrays["mask_lidar"])
        np.testing.assert_array_equal(lidar, masks.free | masks.occupied)


def test_the_plain_layout_holds_everything(tmp_path) -> None:
    masks = made_masks()
    (path,) = files_of(tmp_path, "npz", masks).values()
    with np.load(path, allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["state"], masks.state)
        np.testing.assert_array_equal(arrays["probability"], masks.probability)
        np.testing.assert_array_equal(arrays["mask_lidar_top"], masks.lidar["top"])
        np.testing.assert_array_equal(arrays["mask_camera_back"], masks.camera["back"])
        assert arrays["corner"].tolist() == [0, 0, 0]
        assert float(arrays["cell_m"]) == 0.5


def test_grids_are_those_of_the_benchmarks() -> None:
    """Corner, far corner, and size in bytes, from the data sets' own descriptions."""
    kitti = LAYOUTS["semantickitti"].grid
    np.testing.assert_allclose(kitti.upper, [51.2, 25.6, 4.4])
    assert kitti.size // 8 == 262_144
    assert 2 * kitti.size == 4_194_304
    np.testing.assert_allclose(LAYOUTS["occ3d-nuscenes"].grid.upper, [40, 40, 5.4])
    np.testing.assert_allclose(LAYOUTS["occ3d-waymo"].grid.upper, [40, 40, 5.4])
    np.testing.assert_allclose(LAYOUTS["surroundocc"].grid.upper, [50, 50, 3])
    np.testing.assert_allclose(LAYOUTS["occnet"].grid.upper, [50, 50, 3])
    np.testing.assert_allclose(LAYOUTS["openoccupancy"].grid.upper, [51.2, 51.2, 3])


def test_mistakes_are_told(tmp_path) -> None:
    with pytest.raises(OutputError, match="there is no layout 'kitti'; choose one of semantick"):
        layout_named("kitti")
    masks = made_masks()
    large = replace(masks, label=np.where(masks.occupied, 300, 0).astype(np.uint16))
    with pytest.raises(OutputError, match=r"classes up to 255, and the labels go up to 300"):
        layout_named("occ3d-nuscenes").write(NAME, large)
