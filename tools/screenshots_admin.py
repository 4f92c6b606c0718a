"""Pictures of the dashboard with simulated participants: `make screenshots` writes them to docs/images.

Needs the clips of Experiment 3 and the characters' strips (`make run`). No person gave these ratings: every
run is marked synthetic, in the pictures too.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from tools.screenshots import IMAGES, keep  # noqa: E402

PAGES = {
    "admin-monitor": "/studies/exp3/monitor",
    "admin-results": "/studies/exp3/results",
    "admin-blinks": "/blinks",
}
PEOPLE = 12


def pictures(folder: Path, stimuli: Path) -> None:
    """A server with the study, its people, and an owner who looks."""
    from tests.browser.conftest import CHROMIUM_FLAGS
    from tests.browser.server_process import ServerProcess

    process = ServerProcess(folder / "data")
    declaration = (ROOT / "experiments" / "exp3.toml").read_text(encoding="utf-8")
    process.add_built_study(stimuli / "exp3", declaration)
    if (stimuli / "strips").is_dir():
        shutil.copytree(stimuli / "strips", process.settings.strips_folder)
    process.start()
    try:
        simulate(process.settings.data_folder, process.settings.secret_key, process.address)
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path=shutil.which("chromium"), args=CHROMIUM_FLAGS
            )
            page = browser.new_page(viewport={"width": 1280, "height": 800}, locale="en-GB")
            sign_in(page, process.address, process.settings)
            for name, path in PAGES.items():
                page.goto(f"{process.address}/admin{path}")
                show_simulated(page)
                keep(page, name)
            browser.close()
    finally:
        process.stop()


def show_simulated(page: Page) -> None:
    """Wait for what a page shows, and have those shown who took part: simulated people."""
    page.wait_for_load_state("load")
    page.wait_for_timeout(1500)
    simulated = page.get_by_role("radiogroup").get_by_text("Simulated")
    if simulated.count():
        simulated.click()
    page.wait_for_timeout(3000)


def simulate(data: Path, key: str, address: str) -> None:
    environment = os.environ | {"PALPEBRA_DATA_FOLDER": str(data), "PALPEBRA_SECRET_KEY": key}
    command = [
        sys.executable,
        "-m",
        "server",
        "simulate",
        "exp3",
        "--participants",
        str(PEOPLE),
        "--url",
        address,
    ]
    subprocess.run(command, cwd=ROOT, env=environment, check=True)


def sign_in(page: Page, address: str, settings) -> None:  # type: ignore[no-untyped-def]
    from server.accounts import invitations
    from server.cli_common import migrated_services
    from tests.helpers.admins import PASSWORD

    with migrated_services(settings) as services:
        _, token = invitations.invite(services.database, "owner", "", None)
    page.goto(f"{address}/admin/invitation#{token}")
    page.get_by_label("Name to sign in with").fill("ada")
    page.locator("input[autocomplete=new-password]").fill(PASSWORD)
    page.get_by_role("button", name="Make the account").click()
    page.get_by_role("heading", name="Studies").wait_for()


def main() -> None:
    stimuli = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "data" / "stimuli"
    if not (stimuli / "exp3" / "manifest.json").is_file():
        sys.exit(f"error: expected the built clips of exp3 in {stimuli / 'exp3'}; run `make run`")
    IMAGES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        pictures(Path(folder), stimuli)
    print(f"pictures in {IMAGES.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
