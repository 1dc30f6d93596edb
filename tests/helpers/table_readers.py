"""What people see of a table, read back from its Markdown and HTML."""

import html
import re


def pipe_rows(markdown):
    """The cells of each row of the pipe tables, the rules below the headers left out."""
    rows = []
    for line in markdown.splitlines():
        if line.startswith("|") and not re.fullmatch(r"[|\-: ]+", line):
            cells = re.split(r"(?<!\\)\|", line[1:-1])
            rows.append([cell.strip().replace("\\|", "|") for cell in cells])
    return rows


def html_cells(page):
    """The cells of all rows, bold ones marked as in Markdown."""
    cells = re.findall(r"<t[dh](?: [^>]*)?>(.*?)</t[dh]>", page)
    return [html.unescape(re.sub(r"</?strong>", "**", cell)) for cell in cells]
