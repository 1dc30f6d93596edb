"""The readme of a package index: README.md, with its links into the repository made absolute."""

import re
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).parent


def quoted(path: str, name: str) -> str:
    """Return the text that a file gives a name, without parsing: Python 3.10 has no tomllib."""
    return re.findall(rf'^{name} = "(.+)"', (ROOT / path).read_text("utf-8"), re.MULTILINE)[0]


def index_readme() -> str:
    """Return README.md as it reads outside of the repository."""
    repository = quoted("pyproject.toml", "Repository")
    tag = "v" + quoted("src/nbv/__init__.py", "__version__")

    def absolute(match: re.Match[str]) -> str:
        kind = "raw" if match[2].endswith((".png", ".gif", ".svg")) else "blob"
        return f"{match[1]}{repository}/{kind}/{tag}/{match[2]}"

    text = (ROOT / "README.md").read_text("utf-8")
    return re.sub(r"(\]\(|(?:src|href)=\")(?![a-z]+:|#)([^)\s\"]+)", absolute, text)


if __name__ == "__main__":
    setup(long_description=index_readme(), long_description_content_type="text/markdown")
