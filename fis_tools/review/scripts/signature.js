// What the reviewer decides: on findings, checks and the whole; saved as JSON tied to the controller, and loaded again.

const SIGNATURE = { schema: "review-signature", schema_version: 1 };

function decisionCells() {
  return [...document.querySelectorAll("td.decision")].map((cell) => ({
    cell,
    key: cell.dataset.key,
    severity: cell.closest("tr").querySelector(".severity").textContent,
    state: cell.querySelector("select"),
    reason: cell.querySelector("input"),
  }));
}

/** The fields of the form, checks apart from the others. */
function formFields() {
  const fields = [...document.getElementById("signature").elements].filter(({ name }) => name);
  const isCheck = ({ type }) => type === "checkbox";
  return { checks: fields.filter(isCheck), texts: fields.filter((field) => !isCheck(field)) };
}

/** What is entered, as plain data. */
function enteredSignature({ name, sha256 }) {
  const { checks, texts } = formFields();
  const findings = decisionCells().map(({ key, state, reason }) => ({
    finding: key,
    decision: state.value || "open",
    reason: reason.value.trim(),
  }));
  return {
    ...SIGNATURE,
    controller: { name, sha256 },
    ...Object.fromEntries(texts.map((field) => [field.name, field.value.trim()])),
    checks: Object.fromEntries(checks.map((field) => [field.name, field.checked])),
    findings,
  };
}

/** Enter what a file holds; return in words what came of it. */
function enterSignature(text, { sha256 }) {
  let saved;
  try {
    saved = JSON.parse(text);
  } catch {
    return "This file is not JSON; load one that a review page saved.";
  }
  if (saved?.schema !== SIGNATURE.schema || saved.schema_version !== SIGNATURE.schema_version) {
    return "This file is no saved review; load one that a review page saved.";
  }
  if (saved.controller?.sha256 !== sha256) {
    const other = `${saved.controller?.name}, SHA-256 ${saved.controller?.sha256}`;
    return `This file is about another controller (${other}); nothing was loaded.`;
  }
  const { checks, texts } = formFields();
  for (const field of texts) field.value = String(saved[field.name] ?? "");
  for (const field of checks) field.checked = saved.checks?.[field.name] === true;
  const decided = new Map((saved.findings ?? []).map((one) => [one.finding, one]));
  for (const { key, state, reason } of decisionCells()) {
    const one = decided.get(key);
    state.value = one && one.decision !== "open" ? one.decision : "";
    reason.value = one?.reason ?? "";
    decided.delete(key);
  }
  const lost = decided.size ? ` ${decided.size} of its findings are not on this page.` : "";
  return `Loaded.${lost}`;
}

/** Say what is missing before this can be signed; mark reasons that are missing. */
function openWords() {
  const cells = decisionCells();
  const isUnreasoned = ({ state, reason }) => state.value === "waived" && !reason.value.trim();
  for (const one of cells) one.reason.setAttribute("aria-invalid", String(isUnreasoned(one)));
  const { checks, texts } = formFields();
  const counted = (count, noun, words) => (count ? [`${count} ${noun}${count === 1 ? "" : "s"} ${words}`] : []);
  const missing = [
    ...counted(cells.filter(({ severity, state }) => severity !== "note" && !state.value).length, "finding", "open"),
    ...counted(cells.filter(isUnreasoned).length, "finding", "waived without a reason"),
    ...counted(checks.filter(({ checked }) => !checked).length, "check", "not ticked"),
    ...texts.filter(({ name, value }) => name !== "remarks" && !value.trim()).map(({ name }) => `no ${name}`),
  ];
  return missing.length ? `Still missing: ${missing.join(", ")}.` : "Complete.";
}

/** Paper shows what is entered as text. */
function mirrorForPaper() {
  for (const { cell, state, reason } of decisionCells()) {
    cell.dataset.printed = [state.value || "open", reason.value.trim()].filter(Boolean).join(": ");
    cell.closest("tr").classList.toggle("decided", state.value !== "");
  }
  const { checks, texts } = formFields();
  for (const field of checks) field.parentElement.dataset.printed = field.checked ? "☑ " : "☐ ";
  for (const field of texts) field.parentElement.dataset.printed = field.value.trim();
  const notes = decisionCells().filter(({ severity, state }) => severity === "note" && !state.value).length;
  const table = document.getElementById("findings-table");
  if (table) table.parentElement.dataset.printed = notes ? `Notes without a decision, not printed: ${notes}.` : "";
}

function followSignature(controller) {
  const status = document.getElementById("signature-status");
  const tell = (words = "") => {
    status.textContent = [words, openWords()].filter(Boolean).join(" ");
    mirrorForPaper();
  };
  for (const { state, reason } of decisionCells()) {
    for (const field of [state, reason]) field.addEventListener("input", () => tell());
  }
  const form = document.getElementById("signature");
  form.addEventListener("input", () => tell());
  form.addEventListener("submit", (event) => event.preventDefault());
  document.getElementById("save").addEventListener("click", () => {
    const text = `${JSON.stringify(enteredSignature(controller), null, 2)}\n`;
    const address = URL.createObjectURL(new Blob([text], { type: "application/json" }));
    const link = make("a", { href: address, download: `review-${controller.sha256.slice(0, 12)}.json` });
    link.click();
    URL.revokeObjectURL(address);
    tell("Saved.");
  });
  const load = document.getElementById("load");
  load.addEventListener("change", async () => {
    if (load.files.length) tell(enterSignature(await load.files[0].text(), controller));
    load.value = "";
  });
  const printing = (isWhole) => () => {
    document.documentElement.toggleAttribute("data-summary", !isWhole);
    print();
    document.documentElement.removeAttribute("data-summary");
  };
  document.getElementById("print-summary").addEventListener("click", printing(false));
  document.getElementById("print-all").addEventListener("click", printing(true));
  tell();
}
