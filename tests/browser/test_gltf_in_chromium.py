"""An exported performance in a page: three.js loads the glTF in Chromium and plays the engine's lids."""

from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, Route

from blink_engine import perform
from stimuli_builder.performance.run import PerformanceJob, write_performance
from tests.conftest import REPOSITORY

pytestmark = pytest.mark.browser
FPS, SECONDS = 60.0, 20.0
THREE = REPOSITORY / "frontend" / "node_modules" / "three"
ORIGIN = "http://three.test"
PAGE = """<!doctype html><title>glTF</title>
<script type="importmap">{"imports": {"three": "/build/three.module.js"}}</script>
<script type="module">
  import { AnimationMixer } from "three";
  import { GLTFLoader } from "/examples/jsm/loaders/GLTFLoader.js";
  const { scene, animations } = await new GLTFLoader().loadAsync("/blinks.gltf");
  const mixer = new AnimationMixer(scene);
  for (const clip of animations) mixer.clipAction(clip).play();
  let face = null;
  scene.traverse((node) => { if (node.morphTargetInfluences) face = node; });
  window.at = (time_s) => { mixer.setTime(time_s); return [...face.morphTargetInfluences]; };
</script>"""


def test_three_js_in_chromium_plays_the_engines_lids(page: Page, tmp_path: Path) -> None:
    if not THREE.is_dir():
        pytest.skip("three.js is not installed: run `make setup-test`")
    made = tmp_path / "blinks.gltf"
    write_performance(PerformanceJob(made, None, "gltf", FPS, 7, "speaking", SECONDS))

    def serve(route: Route) -> None:
        path = route.request.url.removeprefix(ORIGIN)
        if path == "/":
            route.fulfill(body=PAGE, content_type="text/html")
        elif path == "/blinks.gltf":
            route.fulfill(body=made.read_bytes(), content_type="model/gltf+json")
        else:
            route.fulfill(body=(THREE / path[1:]).read_bytes(), content_type="text/javascript")

    page.route(f"{ORIGIN}/**", serve)
    page.goto(f"{ORIGIN}/")
    page.wait_for_function("window.at !== undefined")
    engine = perform(SECONDS, FPS, seed=7, state="speaking")
    frames = np.flatnonzero(engine.left > 0.05)
    frames = frames[np.linspace(0, frames.size - 1, 10).astype(int)]
    read = page.evaluate(
        "(times) => times.map((time_s) => window.at(time_s))", [f / FPS for f in frames.tolist()]
    )
    np.testing.assert_allclose(read, np.column_stack([engine.left[frames], engine.right[frames]]), atol=1e-4)
