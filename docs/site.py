"""What `mkdocs build` takes from outside docs/: README, changelog, and a page of the API a room.

MkDocs calls the functions named on_… (hooks of mkdocs.yml).
"""

from __future__ import annotations

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
PACKAGES = {"src/poise": "poise", "envs": "poise.envs", "baselines": "poise.baselines"}
PACKAGES |= {"training": "poise.training", "configs": "poise.configs"}
PUBLIC = ("poise", "poise.envs", "poise.baselines", "poise.training")  # whose names users import
# Links of README to what has no page.
TOP = re.compile(r"(?<!!)\[([^\]]+)\]\((?!https?:|#|docs/)([^)#]*?)/?\)")
DIFFERENT = {"README.md": "index.md", "CHANGELOG.md": "changelog.md"}


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Adds the API to the navigation: what is public, then the rooms behind it."""
    assert config.nav is not None
    packages: dict[str, list[str]] = {}
    for name in rooms():
        packages.setdefault(".".join(name.split(".")[:2]), []).append(api_page(name))
    public = [{f"{name}, public": api_page(name)} for name in PUBLIC]
    inside = [{name: pages} for name, pages in packages.items()]
    config.nav.append({"API": ["api/index.md", *public, {"Inside": inside}]})
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the pages that are not in docs/."""
    pages = {"index.md": from_top("README.md"), "changelog.md": from_top("CHANGELOG.md")}
    pages["api/index.md"] = api_index()
    pages |= {api_page(name): api_text(name, modules) for name, modules in rooms().items()}
    for path, text in pages.items():
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Links to README and the changelog lead to their pages; the search leaves out the log."""
    if page.file.src_uri.startswith("log/"):
        page.meta["search"] = {"exclude": True}
    return re.sub(
        r"\]\((?:\.\./)+(README|CHANGELOG)\.md",
        lambda found: f"]({'../' * page.file.src_uri.count('/')}{DIFFERENT[f'{found[1]}.md']}",
        markdown,
    )


def from_top(name: str) -> str:
    """A page of the root as one of docs/; what has no page there stays as text."""
    text = (ROOT / name).read_text()
    for other, page in DIFFERENT.items():
        text = text.replace(f"]({other}", f"](docs/{page}")
    return TOP.sub(lambda found: without_page(*found.groups()), text).replace("](docs/", "](")


def without_page(text: str, path: str) -> str:
    """A link to a file that has no page, as text."""
    return f"`{path}`" if text.rstrip("/") == path else f"{text} (`{path}`)"


def rooms() -> dict[str, list[str]]:
    """Package → its modules, one level of folders at a time, from the files themselves."""
    found: dict[str, list[str]] = {}
    for folder, package in PACKAGES.items():
        for path in sorted((ROOT / folder).rglob("*.py")):
            parts = path.relative_to(ROOT / folder).with_suffix("").parts
            name = ".".join((package, *parts[:-1]))
            if not parts[-1].startswith("_"):
                found.setdefault(name, []).append(f"{name}.{parts[-1]}")
            elif parts[-1] == "__init__":
                found.setdefault(name, []).insert(0, name)
    return dict(sorted(found.items()))


def api_page(name: str) -> str:
    return f"api/{name}.md"


def api_text(name: str, modules: list[str]) -> str:
    """Docstrings of a room, a section for each file."""
    directives = [f"::: {module}\n" for module in modules if module != name]
    own = f"::: {name}\n    options: {{heading_level: 1, show_submodules: false}}\n"
    return "\n".join([f"---\ntitle: {name}\n---\n", own, *directives])


def api_index() -> str:
    """A line for each room."""
    lines = [f"| [`{name}`]({name}.md) | {first_line(name)} |" for name in rooms()]
    head = ["# API", "", "Equations, shapes, units and errors stand in the docstrings.", ""]
    return "\n".join([*head, "| package | what is in it |", "|---|---|", *lines, ""])


def first_line(name: str) -> str:
    """The first sentence of a package's docstring."""
    (folder,) = (f for f, package in PACKAGES.items() if package == ".".join(name.split(".")[:2]))
    parts = name.split(".")[1 if folder == "src/poise" else 2 :]
    text = ROOT.joinpath(folder, *parts, "__init__.py").read_text()
    found = re.match(r'"""(.*?)(?:\n\n|""")', text, re.DOTALL)
    return " ".join(found[1].split()).replace("|", "\\|") if found else ""
