"""The table of the leaderboard is that of the rows that are kept, and these are of the suite as it is."""

from pathlib import Path

from benchmarks.contenders import CONTENDERS
from benchmarks.leaderboard import COLUMNS, Rows, table, with_table
from pipeline.gym.suite import TASKS, VERSION

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = (DOCS / "results" / "field.md").read_text(encoding="utf-8")
ROWS = Rows(DOCS / "results" / "leaderboard.json")


def test_the_page_shows_the_rows() -> None:
    assert with_table(PAGE, table(ROWS, "paper", 300)) == PAGE


def test_each_row_is_of_a_contender_within_its_budget_or_of_what_comes_with_the_product() -> None:
    assert ROWS.rows
    for row in ROWS.rows:
        assert row["suite"] == VERSION
        assert row["task"] in TASKS
        assert row["figures"].keys() <= COLUMNS.keys()
        if "budget" in row:
            assert row["name"] in CONTENDERS
            assert 0 < row["periods"] <= row["budget"]
    learned = [row for row in ROWS.rows if "budget" in row]
    assert {row["name"] for row in learned} == CONTENDERS.keys()
    keys = {tuple(row[name] for name in ("name", "budget", "seed", "periods", "is_last")) for row in learned}
    assert len(keys) == len(learned)
