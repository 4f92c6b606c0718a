"""A participant in a browser: the screens as a person goes through them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from playwright.sync_api import ElementHandle, Page

AXE = Path(__file__).resolve().parents[2] / "frontend" / "node_modules" / "axe-core" / "axe.min.js"
WCAG = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]
ANY_SCREEN = ".ready, .attention, .break, form, .code"
Look = Callable[[str], None]
UNSENT = """() => new Promise((resolve, reject) => {
  const opening = indexedDB.open("palpebra");
  opening.onerror = () => reject(opening.error);
  opening.onsuccess = () => {
    const reading = opening.result.transaction("outbox").objectStore("outbox").getAll();
    reading.onsuccess = () => { opening.result.close(); resolve(reading.result); };
  };
})"""
"""What the page has kept and not yet sent, in whatever order the browser keeps it."""


class Visit:
    """One page of one participant. `look(name)` is called at each screen."""

    def __init__(self, page: Page, address: str, look: Look = lambda name: None) -> None:
        self.page, self.address, self.look = page, address, look
        self.problems: list[str] = []
        page.on("pageerror", lambda error: self.problems.append(str(error)))
        page.on("console", lambda message: message.type == "error" and self.problems.append(message.text))

    def open(self, link: str, query: str = "") -> "Visit":
        self.page.goto(f"{self.address}/run/{link}{query}")
        self.page.wait_for_selector("h1, .trial")
        return self

    def begin(self, age: str = "34") -> "Visit":
        """Start page, consent, the form before."""
        page = self.page
        page.wait_for_selector("text=About")
        self.look("start")
        page.click(".primary")
        page.wait_for_selector(".page > .tick")
        self.look("consent")
        page.check("input[type=checkbox]")
        page.click(".primary")
        self.form(age)
        return self

    def form(self, age: str = "34") -> None:
        """The form before, with an answer to each required question."""
        self.page.wait_for_selector("form")
        self.look("form")
        self.page.fill("input.short", age)
        self.page.check("input[value=normal]")
        self.page.click(".primary")

    def measure(self) -> "Visit":
        """Card, ruler and distance."""
        page = self.page
        for selector, name, press in (
            (".card", "card", ""),
            (".ruler-line", "ruler check", "text=Yes, within"),
            (".blind-field", "distance", "text=Enter the distance"),
            ("input.short", "distance typed", ".primary"),
        ):
            page.wait_for_selector(selector)
            self.look(name)
            if selector == ".card":
                fit_card(page)
            else:
                page.click(press)
        return self

    def instructions(self) -> "Visit":
        self.page.wait_for_selector(".prose h1, .prose h2")
        self.look("instructions")
        self.page.click(".primary")
        return self

    def practice(self, trials: int = 1) -> "Visit":
        page = self.page
        page.wait_for_selector("text=not part of the study")
        self.look("practice")
        page.click(".primary")
        for _ in range(trials):
            self.rate("5")
            page.wait_for_selector(".feedback")
            self.look("feedback")
            page.keyboard.press("Enter")
        page.wait_for_selector("text=Practice is complete")
        self.look("practice done")
        page.click(".primary")
        return self

    def rate(self, key: str = "4") -> None:
        """One trial by keyboard: start, watch, answer."""
        self.page.wait_for_selector(".ready")
        self.look("ready")
        self.page.keyboard.press(" ")
        self._answer(lambda: self.page.keyboard.press(key))

    def _answer(self, press: Callable[[], None]) -> None:
        scale = self.page.wait_for_selector(".scale")
        self.look("scale")
        press()
        _gone(scale)

    def trials(self, most: int = 1_000, key: str = "4") -> int:
        """Go through whatever comes until the completion code; returns how many clips were rated."""
        rated = 0
        while rated < most:
            self.page.wait_for_selector(ANY_SCREEN)
            if self.page.query_selector(".code"):
                self.look("done")
                break
            rated += self._one_screen(key)
        return rated

    def _one_screen(self, key: str) -> int:
        page = self.page
        if page.query_selector(".ready"):
            self.rate(key)
            return 1
        if page.query_selector(".attention"):
            wanted = page.inner_text(".question strong")
            self._answer(lambda: page.keyboard.press(wanted))
            return 0
        screen = page.query_selector(".break, form")
        self.look("break" if page.query_selector(".break") else "form after")
        page.click(".primary:enabled")
        _gone(screen)
        return 0

    def code(self) -> str:
        return self.page.inner_text(".code output")


CARD_PX = 324
"""The card's long side on a screen of 96 pixels per inch."""


def fit_card(page: Page, *widths: int) -> None:
    """Measure the card, twice by default, each time from the size that it begins with."""
    for number, width in enumerate(widths or (CARD_PX, CARD_PX), start=1):
        page.wait_for_selector(f".card-area[data-round='{number}']")
        page.fill(".card-area input", str(width))
        page.click("text=It fits")


def wait_until_sent(page: Page) -> None:
    """Back once the page has received and used the server's answer to everything it has sent.

    A row in the database is not enough: the answer may still be on its way to the page.
    """
    for _ in range(300):
        if not page.evaluate(UNSENT):
            return
        page.wait_for_timeout(100)
    raise AssertionError("expected an empty outbox within 30 s")


def _gone(element: ElementHandle | None) -> None:
    if element is not None:
        element.wait_for_element_state("hidden")


def axe_violations(page: Page) -> list[str]:
    """What axe-core finds against WCAG 2.2 AA on the page as it is."""
    page.evaluate(AXE.read_text(encoding="utf-8") + "; 0")
    found: list[dict[str, Any]] = page.evaluate(
        "tags => axe.run(document, { runOnly: tags }).then(result => result.violations)", WCAG
    )
    return [f"{one['id']}: {[node['html'][:120] for node in one['nodes']]}" for one in found]
