"""Build the documentation site: python -m tools.site [--serve]   (extra `docs`)

Collects the README pages, makes an API page for each package and every effect, and runs `mkdocs build --strict` into build/site.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
from pathlib import Path

from tools.site import reference
from twin.effects import catalogue

ROOT = Path(__file__).resolve().parents[2]
PAGES = ROOT / "build" / "site_pages"
PICTURES = ("tools/figures/*.*g", "models/*/*.svg")
LINK = re.compile(r"\[([^\]]*)\]\((?!https?:|#)([^)#\s]+)(#[^)]*)?\)")
API = (  # module, what stands on its page
    ("twin", "The public names"),
    ("twin.measurements", "Measurement sets"),
    ("twin.effects.base.effect", "What an effect is"),
    ("twin.prediction.twin", "Twins"),
    ("twin.diagnosis.pipeline", "Diagnosis"),
    ("twin.diagnosis.diagnosis", "What a diagnosis finds"),
    ("twin.prediction.rollout", "Rollouts"),
    ("twin.shape", "Shape estimators"),
    ("twin.control", "Controllers"),
    ("twin.env", "Environments"),
)


def main(serve: bool) -> None:
    shutil.rmtree(PAGES, ignore_errors=True)
    pages = {path: _target(path) for path in _readmes()}
    for path, target in pages.items():
        _write(target, _relinked(path, pages))
    for module, title in API:
        _write(f"api/{module}.md", f"# {title}\n\n::: {module}\n")
    for name, effect in catalogue().items():
        _write(f"effects/{name}.md", f"# {name}\n\n::: {effect.__module__}\n")
    _write("effects/index.md", "# Effects\n\n" + "\n".join(f"- [{name}]({name}.md)" for name in catalogue()) + "\n")
    _write("reference.md", reference.page())
    for picture in (p for folder in PICTURES for p in ROOT.glob(folder)):
        copy = PAGES / picture.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(picture, copy)
    verb = ["serve"] if serve else ["build", "--strict", "--quiet"]
    subprocess.run(
        [sys.executable, "-m", "mkdocs", *verb, "--config-file", str(Path(__file__).with_name("mkdocs.yml"))], check=True
    )


def _readmes() -> list[Path]:
    """The pages: README, CHANGELOG, CONTRIBUTING, those of packages, robots and tools."""
    top = [ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")]
    return [
        *top,
        *sorted(ROOT.glob("twin/**/README.md")),
        *sorted(ROOT.glob("models/**/*.md")),
        *sorted(ROOT.glob("tools/**/*.md")),
    ]


def _target(path: Path) -> str:
    """Where a page stands in the site; README.md is its folder's index."""
    return str(path.relative_to(ROOT)).replace("README.md", "index.md")


def _relinked(path: Path, pages: dict[Path, str]) -> str:
    """The page's text: links to other pages kept; of links to files that are no pages the words."""

    def link(found: re.Match[str]) -> str:
        goal = (path.parent / found[2]).resolve()
        goal = goal / "README.md" if goal.is_dir() and (goal / "README.md") in pages else goal
        if goal in pages:
            up = "../" * (len(Path(pages[path]).parts) - 1)
            return f"[{found[1]}]({up}{pages[goal]}{found[3] or ''})"
        return found[0] if goal.suffix in (".svg", ".png", ".gif") and goal.exists() else found[1]

    return LINK.sub(link, path.read_text("utf-8"))


def _write(target: str, text: str) -> None:
    file = PAGES / target
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, "utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--serve", action="store_true", help="show the site in a browser while pages are edited")
    main(parser.parse_args().serve)
