"""Write what pyproject.toml, nbv.__version__ and CHANGELOG.md say of a release where it is cited.

    python tools/metadata.py              CITATION.cff, codemeta.json, joss/paper.md
    python tools/metadata.py --release    the same, and refuse what the owner has not filled in

What has no other home, such as the abstract, is edited in those files and kept.
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

import yaml

import nbv

ROOT = Path(__file__).parents[1]
OWNERS = "OWNER"


def placeholders(project: str) -> list[str]:
    """Return the lines of pyproject.toml that its owner has not filled in."""
    lines = project.splitlines()
    return [line for line in lines if OWNERS in line and not line.startswith("#")]


def release_date(changelog: str, version: str) -> str:
    """Return the date of a version's heading in CHANGELOG.md."""
    found = re.search(rf"^## \[{re.escape(version)}\] - (\d+-\d+-\d+)$", changelog, re.MULTILINE)
    if found is None:
        sys.exit(f"CHANGELOG.md: no heading `## [{version}] - YYYY-MM-DD`")
    return found[1]


def person(author: dict[str, str]) -> dict[str, str]:
    """Return an author of pyproject.toml as in CITATION.cff: one without an email is a group."""
    if "email" not in author:
        return {"name": author["name"]}
    given, _, family = author["name"].rpartition(" ")
    return {"family-names": family, "given-names": given, "email": author["email"]}


def citation(old: dict[str, Any], project: dict[str, Any], date: str, doi: str) -> dict[str, Any]:
    """Return CITATION.cff."""
    new = old | {
        "authors": [person(author) for author in project["authors"]],
        "version": nbv.__version__,
        "date-released": date,
        "license": project["license"],
        "repository-code": project["urls"]["Repository"],
        "keywords": project["keywords"],
        "doi": doi,
    }
    if doi == OWNERS:
        del new["doi"]
    return new


def codemeta(cited: dict[str, Any], project: dict[str, Any]) -> dict[str, Any]:
    """Return codemeta.json, from CITATION.cff."""

    def authors(given: list[dict[str, str]]) -> list[dict[str, str]]:
        names = {"name": "name", "family-names": "familyName", "given-names": "givenName"}
        return [
            {"@type": "Organization" if "name" in one else "Person"}
            | {names[key]: value for key, value in one.items() if key in names}
            for one in given
        ]

    paper = cited["preferred-citation"]
    identifier = {"identifier": f"https://doi.org/{cited['doi']}"} if "doi" in cited else {}
    return {
        "@context": "https://w3id.org/codemeta/3.0",
        "@type": "SoftwareSourceCode",
        "name": cited["title"],
        "description": cited["abstract"],
        "version": cited["version"],
        "datePublished": cited["date-released"],
        "author": authors(cited["authors"]),
        "license": f"https://spdx.org/licenses/{cited['license']}",
        "codeRepository": cited["repository-code"],
        "issueTracker": project["urls"]["Issues"],
        "keywords": cited["keywords"],
        "programmingLanguage": "Python",
        "runtimePlatform": f"Python {project['requires-python']}",
        "operatingSystem": ["Linux", "macOS"],
        "softwareRequirements": project["dependencies"],
        "referencePublication": {
            "@type": "ScholarlyArticle",
            "name": paper["title"],
            "author": authors(paper["authors"]),
        },
        **identifier,
    }


def as_yaml(content: dict[str, Any]) -> str:
    """Return YAML in the order of its keys."""
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=100)


def written() -> dict[str, str]:
    """Return each file's content by its path."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    project, own = settings["project"], settings["tool"]["metadata"]
    date = release_date((ROOT / "CHANGELOG.md").read_text("utf-8"), nbv.__version__)
    old = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    cited = citation(old, project, date, own["doi"])
    _, head, body = (ROOT / "joss/paper.md").read_text("utf-8").split("---\n", 2)
    front = yaml.safe_load(head) | {
        "authors": [
            {"name": one["name"]} | ({"orcid": orcid} if orcid else {}) | {"affiliation": 1}
            for one, orcid in zip(project["authors"], own["orcids"], strict=True)
        ],
        "affiliations": [{"index": 1, "name": own["affiliation"]}],
        "tags": project["keywords"],
    }
    for key in ("ai_usage_disclosure", "acknowledgements"):
        heading = f"# {key.replace('_', ' ').capitalize().replace('Ai', 'AI')}\n\n"
        before, after = body.split(heading)
        body = f"{before}{heading}{own[key]}\n\n{after[after.index('# ') :]}"
    return {
        "CITATION.cff": as_yaml(cited),
        "codemeta.json": json.dumps(codemeta(cited, project), indent=2, ensure_ascii=False) + "\n",
        "joss/paper.md": f"---\n{as_yaml(front)}---\n{body}",
    }


def main() -> None:
    """Write the files; for a release, name what is missing."""
    for name, content in written().items():
        (ROOT / name).write_text(content, "utf-8")
    missing = placeholders((ROOT / "pyproject.toml").read_text("utf-8"))
    if "--release" in sys.argv and missing:
        sys.exit("\n".join(["pyproject.toml: fill in before a release:", *missing]))


if __name__ == "__main__":
    main()
