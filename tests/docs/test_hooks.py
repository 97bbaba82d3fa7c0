"""What the site's pages get besides their Markdown."""

import re
from types import SimpleNamespace
from typing import Any

import pytest
from markdown import markdown
from mkdocs.exceptions import PluginError

from docs.scripts import build, hooks

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


def test_an_old_address_leads_to_the_heading_that_stands_for_it(tmp_path):
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / "page.html").write_text('<h2 id="part">Part</h2>')
    config: Any = SimpleNamespace(site_dir=tmp_path, extra={"moved": {"old/one.md": "new/page.md#part"}})
    hooks.on_post_build(config)
    assert 'url=../new/page.html#part"' in (tmp_path / "old" / "one.html").read_text()
    config.extra["moved"] = {"old/one.md": "new/page.md#none"}
    with pytest.raises(PluginError, match=r"leads from old/one\.md to new/page\.md#none, which"):
        hooks.on_post_build(config)
