"""Reading the face kit: packed or as OBJ files, and what is said of a wrong one."""

import json
from pathlib import Path

import numpy as np
import pytest
from face_baking.kit import EXPRESSIONS, FaceKit, load_facekit
from face_baking.kit_obj import read_obj_kit

from experiments.errors import InputError


def repacked(packed: Path, file: Path, drop: str = "", **changes: object) -> Path:
    with np.load(packed) as stored:
        arrays = {name: stored[name] for name in stored.files if name != drop}
    np.savez(file, **(arrays | changes))
    return file


def test_the_packed_kit_is_read_whole(kit: FaceKit) -> None:
    assert kit.neutral.shape == (26719, 3)
    assert set(kit.expressions) == set(EXPRESSIONS)
    assert np.abs(kit.expressions["eyeBlink_L"]).max() > 0.5
    assert len(kit.fingerprint) == 64


def test_a_folder_holds_the_packed_kit_too(packed_kit: Path, kit: FaceKit) -> None:
    assert load_facekit(packed_kit.parent).fingerprint == kit.fingerprint


def write_obj(file: Path, points: np.ndarray, faces: list[list[int]]) -> None:
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    lines += ["f " + " ".join(f"{i + 1}/{i + 1}/{i + 1}" for i in face) for face in faces]
    file.write_text("\n".join(lines) + "\n")


def test_obj_files_give_displacements_and_triangles(tmp_path: Path) -> None:
    model = tmp_path / "FaceXModel"
    model.mkdir()
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    write_obj(model / "generic_neutral_mesh.obj", points, [[0, 1, 2, 3], [0, 1, 2]])
    write_obj(model / "identity000.obj", points + 0.5, [])
    write_obj(model / "smile.obj", points + np.array([0, 0, 2]), [])
    (model / "vertex_indices.json").write_text(json.dumps({"idx_to_landmark_verts": [3, 2]}))
    neutral, faces, modes, shapes, landmarks = read_obj_kit(tmp_path, ["smile"], 1)
    np.testing.assert_allclose(neutral, points)
    assert faces.tolist() == [[0, 1, 2, 3], [0, 1, 2, -1]]
    np.testing.assert_allclose(modes[0], 0.5)
    np.testing.assert_allclose(shapes["smile"][:, 2], 2.0)
    assert landmarks.tolist() == [3, 2]


def test_no_kit_is_said_in_one_line(tmp_path: Path) -> None:
    for place in (tmp_path, tmp_path / "nowhere", tmp_path / "none.npz"):
        with pytest.raises(InputError, match=r"there is no face kit: expected ict_facekit.npz or") as fault:
            load_facekit(place)
        assert "\n" not in str(fault.value)


def test_a_part_of_the_obj_files_names_the_first_that_lacks(tmp_path: Path) -> None:
    write_obj(tmp_path / "generic_neutral_mesh.obj", np.zeros((4, 3)), [[0, 1, 2, 3]])
    with pytest.raises(InputError, match=r"identity000.obj: the face kit is incomplete"):
        load_facekit(tmp_path)


def test_another_mesh_among_the_obj_files_is_refused(tmp_path: Path) -> None:
    write_obj(tmp_path / "generic_neutral_mesh.obj", np.zeros((4, 3)), [[0, 1, 2, 3]])
    write_obj(tmp_path / "identity000.obj", np.zeros((5, 3)), [])
    with pytest.raises(InputError, match=r"expected 4 vertices like generic_neutral_mesh.obj, got 5"):
        load_facekit(tmp_path)


def test_a_packed_kit_that_lacks_an_array_names_it(packed_kit: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"lacks an array .*identity_value"):
        load_facekit(repacked(packed_kit, tmp_path / "kit.npz", drop="identity_value"))


def test_a_packed_kit_of_another_mesh_is_refused(packed_kit: Path, tmp_path: Path) -> None:
    wrong = repacked(packed_kit, tmp_path / "kit.npz", faces=np.zeros((10, 4), np.int16))
    with pytest.raises(InputError, match="26719 vertices and 26384 faces, got 26719 and 10"):
        load_facekit(wrong)


def test_a_packed_kit_without_blinks_names_the_expression(packed_kit: Path, tmp_path: Path) -> None:
    with np.load(packed_kit) as stored:
        names = [f"x{name}" for name in stored["expression_names"]]
    wrong = repacked(packed_kit, tmp_path / "kit.npz", expression_names=np.array(names))
    with pytest.raises(InputError, match="lacks the expression eyeBlink_L"):
        load_facekit(wrong)


def test_a_damaged_file_is_no_kit(tmp_path: Path) -> None:
    file = tmp_path / "kit.npz"
    file.write_bytes(b"PK\x03\x04 not really")
    with pytest.raises(InputError, match="expected a packed face kit"):
        load_facekit(file)
