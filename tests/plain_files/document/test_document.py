"""Documents: every writer says every word, and takes none for markup."""

import json
import re
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from plain_files import document
from plain_files.document import Document, Heading, Paragraph, Result, Table, html, text
from plain_files.document.html import element
from tests.policies import Page, check_policy

NASTY = 'a|b <i>&"_c_ \\d{e} 5 % #f $g ^h ~j [k] *l*'
CHANGES = (document.Change("N", "P"), document.Change("Z", "Z"))
DOCUMENT = Document(
    [
        Heading(NASTY, 1),
        Paragraph(NASTY),
        Heading("below", 3),
        document.Items([f"{NASTY}\nmore", "second"]),
        Table(["name", "number"], [[NASTY, "1"], ["b", "22"]], numbers=(1,)),
        Table(["x \\ y", "low", "high"], [["left", *CHANGES]], across="y"),
        document.Code("python -m fis_tools show *.fis"),
        document.Figure('<svg class="drawn"></svg>'),
    ]
)


def test_text_indents_below_headings_and_aligns_numbers_at_the_right() -> None:
    written = text.write(DOCUMENT)
    lines = written.splitlines()
    assert lines[:2] == [NASTY, f"  {NASTY}"]
    assert lines[3:6] == ["  below", f"    {NASTY}", "      more"]
    assert f"    b{' ' * (len(NASTY) - 1)}      22" in lines
    assert "    left   N → P  ·" in lines
    assert "svg" not in written
    assert not any(line.endswith(" ") for line in lines)


def test_text_lists_the_changes_of_a_table_that_is_too_wide() -> None:
    written = text.write(DOCUMENT, width=15)
    assert re.search(r"\n    left +low +N → P\n", written)
    assert "·" not in written


def test_text_wraps_sentences_but_not_before_a_per_cent_sign() -> None:
    written = text.write(Document([Paragraph("it rose by 5 % " * 20)]), width=40)
    assert all(len(line) <= 40 and not line.lstrip().startswith("%") for line in written.splitlines())


def test_markdown_escapes_what_would_be_markup_and_keeps_tables_whole() -> None:
    written = text.write_markdown(DOCUMENT)
    assert written.startswith('# a\\|b \\<i>&"\\_c\\_ \\\\d{e} 5 % \\#f $g ^h ~j \\[k] \\*l\\*\n')
    (table, changes) = (block for block in written.split("\n\n") if block.startswith("|"))
    bars = [len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()]
    assert bars == [3] * 4
    assert re.fullmatch(r"\| --- +\| +--: \|", table.splitlines()[1])
    assert "~~N~~ → P" in changes
    assert "```\npython -m fis_tools show *.fis\n```" in written


def test_latex_has_no_command_from_a_name() -> None:
    written = text.write_latex(DOCUMENT)
    assert r"\textbackslash{}d\{e\} 5 \% \#f \$g \textasciicircum{}h \textasciitilde{}j" in written
    assert r"\multicolumn{2}{c}{y}" in written
    assert written.count(r"\begin{") == written.count(r"\end{")


def test_a_page_shows_every_word_and_takes_none_for_a_tag() -> None:
    page = html.page(DOCUMENT)
    check_policy(page)
    taken = Page(page)
    assert "".join(words for _, words in taken.texts).count(NASTY) == 5  # with the title
    assert taken.all("i") == []
    assert '<td class="changed"><del>N</del><ins>P</ins></td><td class="same">Z</td>' in page
    assert '<svg class="drawn"></svg>' in page
    assert '<td class="number">22</td>' in page
    assert '<th scope="col" class="number">number</th>' in page
    assert '<th scope="row">left</th>' in page


def test_an_element_escapes_what_is_inside_and_its_attributes() -> None:
    made = element("a", "<b>", element("i", "&"), href='"x"', class_="", text_anchor="end")
    assert made == '<a href="&#34;x&#34;" text-anchor="end">&lt;b&gt;<i>&amp;</i></a>'


class Grade(IntEnum):
    GOOD = 1


@dataclass(frozen=True, repr=False)
class Measured(Result):
    grade: Grade
    values: np.ndarray
    parts: tuple["Measured", ...] = ()

    def document(self) -> Document:
        return Document([Paragraph("found <it>")])


def test_a_result_shows_itself_everywhere() -> None:
    result = Measured(Grade.GOOD, np.array([1.5]))
    assert repr(result) == result.text() == "found <it>\n"
    assert result._repr_markdown_() == "found \\<it>\n"


def test_data_are_plain_and_say_their_schema() -> None:
    result = Measured(Grade.GOOD, np.array([1.5]), (Measured(Grade.GOOD, np.array([])),))
    content = {"grade": "good", "values": [1.5], "parts": [{"grade": "good", "values": [], "parts": []}]}
    assert document.plain(result) == content
    assert json.loads(document.as_json("s", 2, content)) == {"schema": "s", "schema_version": 2, **content}
    without = {"value": float("nan"), "values": (np.float64(np.inf), np.int64(2), np.bool_(True))}
    expected = {"schema": "s", "schema_version": 2, "value": None, "values": [None, 2, True]}
    assert json.loads(document.as_json("s", 2, without)) == expected
