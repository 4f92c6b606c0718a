"""Make the built site work under `script-src 'self'; style-src 'self'`.

Formulas become MathML at build time, so that no script is fetched to draw them. The theme and the search page
write scripts and styles into the pages. After the build each of them moves to a file named by its hash, and
style attributes become classes. What cannot move stops the build.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import Any

from bs4 import BeautifulSoup, Tag
from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.errors import ExtensionError

FOLDER = "_static/inline"
# Only a choice of versions reads the page's name, and it would be one small file for every page.
PAGE_NAME = "DOCUMENTATION_OPTIONS.pagename"
NUMBERED = re.compile(r"\\tag\{(.+?)\}")


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to Sphinx."""
    app.add_html_math_renderer("mathml", (_write_inline_formula, None), (_write_formula, None))
    app.connect("env-updated", drop_copied_pictures)
    app.connect("doctree-resolved", link_to_pictures)
    app.connect("build-finished", move_inline_code)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def drop_copied_pictures(_app: Sphinx, environment: BuildEnvironment) -> None:
    """Copy no picture a second time because a page links to it at full size."""
    for path in [path for path in environment.dlfiles if str(path) in environment.images]:
        del environment.dlfiles[path]


def link_to_pictures(app: Sphinx, page: nodes.document, name: str) -> None:
    """Let a link to a picture that some page shows lead to the copy that is shown."""
    for link in list(page.findall(addnodes.download_reference)):
        path, _ = app.env.relfn2path(link["reftarget"], name)
        if path in app.env.images:
            target = f"{'../' * name.count('/')}_images/{app.env.images[path][1]}"
            link.replace_self(nodes.reference("", "", *link.children, internal=True, refuri=target))


def _write_inline_formula(writer: Any, node: nodes.math) -> None:
    writer.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def _write_formula(writer: Any, node: nodes.math_block) -> None:
    formula, number = NUMBERED.sub("", node.astext()), NUMBERED.search(node.astext())
    said = f"<span class='formula-number'>({number[1]})</span>" if number else ""
    writer.body.append(f"<div class='formula'>{tex2mathml(formula, as_block=True)}{said}</div>")
    raise nodes.SkipNode


def move_inline_code(app: Sphinx, failure: Exception | None) -> None:
    """Rewrite every page of a build that succeeded."""
    if failure is None and app.builder.format == "html":
        for page in sorted(Path(app.outdir).rglob("*.html")):
            page.write_text(without_inline_code(page, Path(app.outdir)), encoding="utf-8")


def without_inline_code(page: Path, site: Path) -> str:
    """The page with its inline scripts and styles in files."""
    soup = BeautifulSoup(page.read_text(encoding="utf-8"), "html.parser")
    up = "../" * len(page.relative_to(site).parent.parts)
    for script in soup.find_all("script", src=False):
        if (script.string or "").lstrip().startswith(PAGE_NAME):
            script.decompose()
        elif script.get("type", "text/javascript") in ("text/javascript", "module"):
            text = script.string or ""
            script.clear()
            script["src"] = up + _kept(site, text, "js")
    for style in soup.find_all("style"):
        link = soup.new_tag("link", rel="stylesheet", href=up + _kept(site, style.string or "", "css"))
        # A stylesheet inside <noscript> stays there: it hides what needs JavaScript.
        style.replace_with(link)
    rules: dict[str, str] = {}
    for element in soup.find_all(style=True):
        declared = str(element["style"]).strip().rstrip(";")
        name = "style-" + hashlib.sha256(declared.encode()).hexdigest()[:8]
        rules[name] = f".{name} {{ {declared}; }}"
        element["class"] = [*_classes(element), name]
        del element["style"]
    if rules and soup.head is not None:
        text = "\n".join(rules[name] for name in sorted(rules))
        soup.head.append(soup.new_tag("link", rel="stylesheet", href=up + _kept(site, text, "css")))
    # The theme's label of this button lacks the keys that it shows, so that speech input does not find it.
    for button in soup.select("button.search-button-field[aria-label]"):
        del button["aria-label"]
    for element in soup.find_all(True):
        handlers = [name for name in element.attrs if name.startswith("on")]
        if handlers:
            raise ExtensionError(f"{page}: expected no inline event handlers, got {', '.join(handlers)}")
    return str(soup)


def _classes(element: Tag) -> list[str]:
    names: Any = element.get("class") or []
    return [names] if isinstance(names, str) else list(names)


def _kept(site: Path, text: str, ending: str) -> str:
    name = f"{FOLDER}/{hashlib.sha256(text.encode()).hexdigest()[:16]}.{ending}"
    file = site / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    return name
