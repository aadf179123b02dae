"""The formats of cameras, images and clouds that `fuzz.py` corrupts; see `fuzz_formats`."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from fuzz_formats import Format


def perception_formats() -> dict[str, Format]:
    """Files of cameras, images and clouds, and the scenario."""
    from pepper_drake.evaluation.own_data import load_depth
    from pepper_drake.perception.cameras.camera_files import (
        load_intrinsics,
        load_stereo,
        make_intrinsics,
    )
    from pepper_drake.perception.cameras.image_files import read_image
    from pepper_drake.perception.mapping.cloud_files import load_cloud
    from pepper_drake.robot_server.robot.floor_map import FloorMap, read_floor_map, write_floor_map
    from pepper_drake.scenario import Scenario, load_scenario, save_scenario

    matrix = [525.0, 0.0, 319.5, 0.0, 525.0, 239.5, 0.0, 0.0, 1.0]
    distortion = [0.1, -0.2, 0.001, 0.0, 0.0]

    def scenario(folder: Path) -> Path:
        save_scenario(Scenario(), folder / "scenario.yaml")
        return folder / "scenario.yaml"

    def camera_info(folder: Path) -> Path:
        (folder / "camera.yaml").write_text(
            "image_width: 640\nimage_height: 480\ncamera_name: head\n"
            f"camera_matrix: {{rows: 3, cols: 3, data: {matrix}}}\n"
            "distortion_model: plumb_bob\n"
            f"distortion_coefficients: {{rows: 1, cols: 5, data: {distortion}}}\n"
        )
        return folder / "camera.yaml"

    def file_storage(name: str) -> Callable[[Path], Path]:
        def make(folder: Path) -> Path:
            storage = cv2.FileStorage(str(folder / name), cv2.FILE_STORAGE_WRITE)
            storage.write("image_width", 640)
            storage.write("image_height", 480)
            storage.write("camera_matrix", np.array(matrix).reshape(3, 3))
            storage.write("distortion_coefficients", np.array(distortion))
            storage.release()
            return folder / name

        return make

    def image(name: str, dtype: type) -> Callable[[Path], Path]:
        def make(folder: Path) -> Path:
            pixels = np.arange(24 * 32, dtype=dtype).reshape(24, 32)
            cv2.imwrite(str(folder / name), pixels)
            return folder / name

        return make

    def cloud(name: str, head: str) -> Callable[[Path], Path]:
        def make(folder: Path) -> Path:
            rows = "".join(f"{0.1 * k} {-0.2 * k} 0.75\n" for k in range(10))
            (folder / name).write_text(head + rows)
            return folder / name

        return make

    pcd = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        "WIDTH 10\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 10\nDATA ascii\n"
    )
    ply = (
        "ply\nformat ascii 1.0\nelement vertex 10\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n"
    )

    def stereo(folder: Path) -> Path:
        identity, zeros = np.eye(3).ravel().tolist(), [0.0] * 5
        square = f"{{rows: 3, cols: 3, data: {matrix}}}"
        lens = f"{{rows: 1, cols: 5, data: {zeros}}}"
        (folder / "stereo.yaml").write_text(
            f"image_width: 640\nimage_height: 480\nM1: {square}\nD1: {lens}\nM2: {square}\n"
            f"D2: {lens}\nR: {{rows: 3, cols: 3, data: {identity}}}\nT: [-0.07, 0.001, 0.0]\n"
        )
        return folder / "stereo.yaml"

    def array(name: str, **arrays: np.ndarray) -> Callable[[Path], Path]:
        def make(folder: Path) -> Path:
            if name.endswith(".npy"):
                np.save(folder / name, *arrays.values())
            else:
                np.savez_compressed(folder / name, **arrays)
            return folder / name

        return make

    def floor_map(folder: Path) -> Path:
        log_odds = np.random.default_rng(0).uniform(-5.0, 5.0, (30, 30))
        write_floor_map(FloorMap(log_odds, np.array([-1.0, -2.0])), folder / "room.explo")
        return folder / "room.explo"

    points = np.random.default_rng(0).random((20, 3))
    lens = np.array([[30.0, 0.0, 15.5], [0.0, 30.0, 11.5], [0.0, 0.0, 1.0]])
    intrinsics = make_intrinsics(lens, np.zeros(5), (32, 24))
    depths = np.linspace(0.5, 2.0, 24 * 32, dtype=np.float32).reshape(24, 32)
    records = np.zeros(6, dtype=[("x", "f4"), ("y", "f4"), ("z", "f8"), ("name", "S3")])

    def depth(path: Path) -> object:
        return load_depth(path, intrinsics)

    def binary(name: str, head: str) -> Callable[[Path], Path]:
        def make(folder: Path) -> Path:
            (folder / name).write_bytes(head.encode() + points[:10].astype("<f4").tobytes())
            return folder / name

        return make

    return {
        **{
            f"image_{suffix}": Format(image(f"photo.{suffix}", np.uint8), read_image)
            for suffix in ("jpg", "tiff", "bmp", "pgm", "webp")
        },
        "depth_npy": Format(array("depth.npy", depth=depths), depth),
        "depth_npz": Format(array("depth.npz", depth=depths), depth),
        "cloud_npy": Format(array("cloud.npy", points=points), load_cloud),
        "cloud_records": Format(array("records.npy", points=records), load_cloud),
        "cloud_npz": Format(array("cloud.npz", points=points), load_cloud),
        "pcd_binary": Format(binary("cloud.pcd", pcd.replace("ascii", "binary")), load_cloud),
        "ply_binary": Format(
            binary("cloud.ply", ply.replace("ascii", "binary_little_endian")), load_cloud
        ),
        "floor_map": Format(floor_map, read_floor_map),
        "stereo": Format(stereo, load_stereo),
        "scenario": Format(scenario, load_scenario),
        "camera_info": Format(camera_info, load_intrinsics),
        "camera_yml": Format(file_storage("camera.yml"), load_intrinsics),
        "camera_json": Format(file_storage("camera.json"), load_intrinsics),
        "camera_xml": Format(file_storage("camera.xml"), load_intrinsics),
        "image": Format(image("photo.png", np.uint8), read_image),
        "depth_image": Format(image("depth.png", np.uint16), depth),
        "pcd": Format(cloud("cloud.pcd", pcd), load_cloud),
        "ply": Format(cloud("cloud.ply", ply), load_cloud),
    }
