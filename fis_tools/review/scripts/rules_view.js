// What fires now, shown in the rule table and in the rule matrix.

/** Keep the column of present strengths and the marks of the matrix at the state's inputs. */
function followRules(section, state) {
  const cells = [...section.querySelectorAll("td.now")];
  const table = section.querySelector("table.rules");
  const squares = [...section.querySelectorAll(".matrix td[data-rule]")];
  state.follow(() => {
    const { firing } = state.inference;
    for (const cell of cells) {
      const strength = firing[Number(cell.dataset.rule)];
      cell.dataset.value = String(strength);
      cell.textContent = strength >= SHOWN_FROM ? strength.toFixed(2) : "–";
    }
    if (cells.length) sortAgain(table, cells[0].cellIndex);
    for (const square of squares) {
      const strength = firing[Number(square.dataset.rule)];
      square.classList.toggle("fires", strength >= SHOWN_FROM);
      square.style.setProperty("--strength", String(strength));
    }
  });
}
