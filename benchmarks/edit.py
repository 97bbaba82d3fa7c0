"""Milliseconds from a touch in the editor's page to what it changes: ``python -m benchmarks edit``.

Measured in a browser on the same machine: to a surface that is drawn anew, to what an audit finds, to the
difference from the original, to the first flights, to all flights. Medians of several touches, each of
another rule.
"""

import argparse
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

from benchmarks.inference import _large_system
from docs.scripts.screenshot import browser_found
from fis_tools.formats.serialize import dump_yaml
from fis_tools.model import FuzzyController

#: presses a rule, as a hand does for 80 ms, and tells when a frame showed what its release changed, ms
TOUCH = """async ([rule, conditions]) => {
    const small = new OffscreenCanvas(24, 24).getContext("2d", { willReadFrequently: true });
    small.globalCompositeOperation = "copy";
    const pixels = () => {
        small.drawImage([...document.querySelectorAll(".surface canvas")].at(-1), 0, 0, 24, 24);
        return small.getImageData(0, 0, 24, 24).data.join();
    };
    const part = (name) => document.querySelector(`section[aria-label="${name}"]`);
    const [flights, findings, changes] = ["Flights", "Findings", "Changes"].map(part);
    const numbers = () => flights?.querySelector("table")?.textContent;
    const rule_button = document.querySelector(`button.term[aria-label^="rule ${rule}:"]:not(.if)`);
    rule_button.focus();
    await new Promise((pressed) => setTimeout(pressed, 80));
    const found = {}, before = pixels(), old = numbers(), start = performance.now();
    const painted = (name) => setTimeout(() => { found[name] ??= performance.now() - start; });
    const shown = (name) => requestAnimationFrame(() => painted(name));
    const asked = {};
    let answered = false;
    new MutationObserver(() => {
        for (const [name, told] of [["findings", findings], ["difference", changes]]) {
            const waiting = told.querySelector(".state").textContent !== "";
            asked[name] ||= waiting;
            if (asked[name] && !waiting) shown(name);
        }
        answered ||= numbers() !== old;
        if (answered) shown("first");
        if (answered && numbers().includes("1,000 flights")) shown("all");
    }).observe(document.body, { subtree: true, childList: true, characterData: true });
    rule_button.click();
    while (conditions.some((name) => !(name in found)) && performance.now() - start < 30000) {
        await new Promise(requestAnimationFrame);
        if (!("surface" in found) && pixels() !== before) painted("surface");
    }
    return found;
}"""
#: no panel computes
SETTLED = "() => ![...document.querySelectorAll('.state')].some((one) => one.innerText)"
#: of an answer that is shown in full
SETTLED_MS = 2_000


def main(arguments: Sequence[str]) -> int:
    """Time both editors; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks edit", description=__doc__)
    parser.add_argument("--touches", type=int, default=9, help="of each editor; 9 unless given")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        # of 125 rules those that the surface shows, in the middle of the third input
        large = Path(folder) / "large.yaml"
        large.write_text(dump_yaml(FuzzyController("large", (_large_system(),))), encoding="utf-8")
        words = ("pipeline", "edit", "controller=champion_27", "sun=random")
        _print(
            "champion_27 and its mission", words, ("surface", "first", "all"), range(1, 10)[: options.touches]
        )
        _print(
            "125 rules",
            ("fis_tools", "edit", str(large)),
            ("surface", "findings", "difference"),
            range(3, 125, 5)[: options.touches],
        )
    return 0


def _print(name: str, words: Sequence[str], conditions: Sequence[str], rules: Sequence[int]) -> None:
    command = [sys.executable, "-m", *words, "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process, sync_playwright() as driver:  # noqa: S603
        assert process.stdout is not None
        browser = driver.chromium.launch(executable_path=browser_found(), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.goto(process.stdout.readline().strip())
        touches = [_touched(page, rule, conditions) for rule in rules]
        browser.close()
        process.terminate()
    print(f"{name}: medians of {len(rules)} touches")
    for condition in conditions:
        spent = [touch[condition] for touch in touches]
        print(
            f"  to {condition:<10}{statistics.median(spent):8.0f} ms  ({min(spent):.0f} to {max(spent):.0f})"
        )


def _touched(page: Page, rule: int, conditions: Sequence[str]) -> Mapping[str, float]:
    """Touch a rule once everything is shown; return what it took."""
    page.wait_for_selector(".variable")
    page.wait_for_timeout(SETTLED_MS)
    page.wait_for_function(SETTLED, timeout=120_000)
    times: Mapping[str, float] = page.evaluate(TOUCH, [rule, list(conditions)])
    return times
