"""What the site's pages get besides their Markdown."""

import re

from markdown import markdown

from docs import build, hooks

TABLE = """
| name | `unit` | its "meaning" |
|---|---:|---|
| a | m | length |
| b | | none |
"""


def test_cells_carry_the_heads_of_their_columns():
    html = hooks.on_page_content(markdown(TABLE, extensions=["tables"]))
    cells = re.findall(r"<td([^>]*)>(.*?)</td>", html)
    heads = [re.search(r'data-head="([^"]*)"', attributes) for attributes, _ in cells]
    assert [head and head[1] for head in heads] == 2 * [None, "unit", "its &quot;meaning&quot;"]
    assert [words for _, words in cells] == ["a", "m", "length", "b", "", "none"]


def test_each_command_has_its_help_on_the_page():
    for module, name in (("fis_tools", "explain"), ("telemetry", "replay")):
        assert f"Usage: python -m {module} {name} " in build.help_of(module, name)
