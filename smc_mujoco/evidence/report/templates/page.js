"use strict";
(() => {
  const all = (selector, from = document) => [...from.querySelectorAll(selector)];
  const PRINTED = 40; // rows of a long table on paper

  // tables: sorting
  const value = (row, k) => {
    const text = row.cells[k].dataset.v ?? row.cells[k].textContent;
    const number = { inf: Infinity, "-inf": -Infinity, nan: NaN }[text] ?? (text.trim() === "" ? NaN : Number(text));
    return { text, number };
  };
  const compare = (a, b) => {
    if (!Number.isNaN(a.number) && !Number.isNaN(b.number)) return a.number === b.number ? 0 : a.number < b.number ? -1 : 1;
    return a.text.localeCompare(b.text);
  };
  const sort = (table, head) => {
    const k = head.cellIndex, body = table.tBodies[0];
    const down = head.getAttribute("aria-sort") === "ascending";
    const missing = (cell) => /^(nan)$/i.test(cell.text);
    const rows = [...body.rows].map((row) => [value(row, k), row]);
    rows.sort(([a], [b]) => missing(a) - missing(b) || (down ? -1 : 1) * compare(a, b)); // what is missing comes last
    for (const other of table.tHead.rows[0].cells) other.setAttribute("aria-sort", "none");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    body.append(...rows.map(([, row]) => row));
  };
  for (const button of all(".sort")) {
    const head = button.closest("th"), table = head.closest("table");
    if (table.classList.contains("sortable")) button.addEventListener("click", () => sort(table, head));
  }

  // tables: filters
  const filter = (id) => {
    const wanted = all(`select[data-table="${id}"]`).filter((pick) => pick.value);
    const rows = [...document.getElementById(id).tBodies[0].rows];
    for (const row of rows) row.hidden = wanted.some((pick) => row.dataset[pick.dataset.column] !== pick.value);
    const shown = rows.filter((row) => !row.hidden).length;
    for (const count of all(`[data-count="${id}"]`)) count.textContent = `${shown} of ${rows.length} rows`;
  };
  for (const pick of all("select[data-table]")) pick.addEventListener("change", () => filter(pick.dataset.table));
  for (const id of new Set(all("select[data-table]").map((pick) => pick.dataset.table))) filter(id);

  // what scrolls is reached by the keyboard
  for (const box of all(".wide, .chart")) {
    if (box.scrollHeight <= box.clientHeight + 1 && box.scrollWidth <= box.clientWidth + 1) continue;
    const name = box.querySelector("caption, figcaption");
    box.tabIndex = 0;
    if (!box.matches("figure")) box.setAttribute("role", "region");
    if (name) box.setAttribute("aria-label", name.textContent.trim());
  }

  // one of several panels
  const press = (group, chosen) => group.forEach((b) => b.setAttribute("aria-pressed", String(b === chosen)));
  const tabs = all("[data-tab]");
  for (const tab of tabs) {
    tab.addEventListener("click", () => {
      press(tabs, tab);
      for (const other of tabs) document.getElementById(other.dataset.tab).hidden = other !== tab;
    });
  }

  // claims by verdict
  const verdicts = all(".verdicts"), claims = all(".claim");
  for (const button of verdicts) {
    button.addEventListener("click", () => {
      const wanted = button.dataset.verdict;
      press(verdicts, button);
      for (const claim of claims) {
        const its = wanted === "flips" ? "flips" in claim.dataset : claim.dataset.verdict === wanted;
        claim.hidden = wanted !== "" && !its;
      }
    });
  }
  for (const button of all("[data-unfold]")) {
    button.addEventListener("click", () => {
      const open = button.textContent === "open all";
      for (const part of all("details", document.getElementById(button.dataset.unfold))) part.open = open;
      button.textContent = open ? "close all" : "open all";
    });
  }

  // the contents show where one is
  const links = new Map(all("nav a").map((a) => [a.getAttribute("href").slice(1), a]));
  const seen = new Set();
  const spy = new IntersectionObserver((entries) => {
    for (const entry of entries) entry.isIntersecting ? seen.add(entry.target.id) : seen.delete(entry.target.id);
    const current = [...links.keys()].find((id) => seen.has(id));
    for (const [id, link] of links) id === current ? link.setAttribute("aria-current", "true") : link.removeAttribute("aria-current");
  }, { rootMargin: "-10% 0px -70% 0px" });
  for (const id of links.keys()) spy.observe(document.getElementById(id));

  // on paper: everything open, long tables cut with a line that says so
  let closed = [];
  addEventListener("beforeprint", () => {
    closed = all("details:not([open])");
    for (const part of closed) part.open = true;
    for (const table of all("table.long")) {
      const rows = [...table.tBodies[0].rows].filter((row) => !row.hidden);
      rows.forEach((row, k) => row.classList.toggle("unprinted", k >= PRINTED));
      const note = document.createElement("p");
      note.className = "printnote";
      const all = table.tBodies[0].rows.length;
      note.textContent = `Printed: ${Math.min(rows.length, PRINTED)} of ${all} rows, those shown on the screen first.`;
      if (all > PRINTED) table.after(note);
    }
  });
  addEventListener("afterprint", () => {
    for (const part of closed) part.open = false;
    for (const note of all(".printnote")) note.remove();
    for (const row of all(".unprinted")) row.classList.remove("unprinted");
  });
  document.documentElement.dataset.ready = "yes";
})();
