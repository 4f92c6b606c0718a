"""The zip holds everything it imports, by relative imports only, and is the same every time."""

import ast
import tomllib
import zipfile
from pathlib import Path

from addon_build.addon import addon_files, build


def test_every_import_is_inside_or_blenders_own() -> None:
    files = addon_files()
    for name, text in files.items():
        if not name.endswith(".py"):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom) and node.level:
                folder = name.rpartition("/")[0]
                target = "/".join(filter(None, [folder, (node.module or "").replace(".", "/")]))
                names = [target] if node.module else [alias.name for alias in node.names]
                assert all(f"{n}.py" in files or f"{n}/__init__.py" in files for n in names), (name, names)
            elif isinstance(node, ast.ImportFrom):
                assert node.module is not None
                assert node.module.split(".")[0] not in ("blender_addon", "blink_engine", "stimuli_builder")


def test_the_same_sources_give_the_same_zip(tmp_path: Path) -> None:
    first, second = build(tmp_path / "a"), build(tmp_path / "b")
    assert first.read_bytes() == second.read_bytes()
    with zipfile.ZipFile(first) as archive:
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
    assert manifest["id"] == "palpebra_blinks"
    assert first.name == f"palpebra_blinks-{manifest['version']}.zip"
