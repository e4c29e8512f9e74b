"use strict";
// Without this script the page shows everything; it only hides, highlights and sorts.
(() => {
  const CROWD = 4;
  const buttons = document.querySelectorAll(".legend button");
  const charts = document.querySelectorAll(".charts");
  const all = (index) => document.querySelectorAll(`.charts .plot .series[data-series="${index}"]`);
  const focus = (index, on) => {
    all(index).forEach((g) => g.classList.toggle("focus", on));
    charts.forEach((chart) => chart.classList.toggle("focused", on));
  };
  const toggle = (index) => {
    const shown = buttons[0] && [...buttons].find((b) => b.dataset.series === index);
    const on = shown.getAttribute("aria-pressed") !== "true";
    buttons.forEach((b) => b.dataset.series === index && b.setAttribute("aria-pressed", on));
    all(index).forEach((g) => g.classList.toggle("off", !on));
    const names = new Set([...buttons].filter((b) => b.getAttribute("aria-pressed") === "true")
      .map((b) => b.dataset.series));
    charts.forEach((chart) => chart.classList.toggle("crowded", names.size > CROWD));
    focus(index, on);
  };
  buttons.forEach((button) => {
    const index = button.dataset.series;
    const pressed = () => button.getAttribute("aria-pressed") === "true";
    button.addEventListener("click", () => toggle(index));
    button.addEventListener("pointerenter", (e) => e.pointerType === "mouse" && pressed() && focus(index, true));
    button.addEventListener("pointerleave", () => focus(index, false));
    button.addEventListener("blur", () => focus(index, false));
  });

  const compare = (a, b) => {
    const [x, y] = [a, b].map((row) => row.dataset.value);
    if (x === "" || y === "") return (x === "") - (y === "");
    const [p, q] = [Number(x), Number(y)];
    return Number.isNaN(p) || Number.isNaN(q) ? x.localeCompare(y) : p - q;
  };
  document.querySelectorAll("thead button").forEach((button) => {
    button.addEventListener("click", () => {
      const head = button.closest("th");
      const table = head.closest("table");
      const body = table.tBodies[0];
      const sign = head.getAttribute("aria-sort") === "descending" ? 1 : -1;
      table.querySelectorAll("th[aria-sort]").forEach((th) => th.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", sign < 0 ? "descending" : "ascending");
      const cell = (row) => row.cells[head.cellIndex];
      const rows = [...body.rows].sort((a, b) => {
        const [x, y] = [cell(a), cell(b)];
        const empty = x.dataset.value === "" || y.dataset.value === "";
        return (empty ? 1 : sign) * compare(x, y);
      });
      body.append(...rows);
    });
  });
})();
