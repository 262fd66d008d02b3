"use strict";

function sortable(table) {
  const headers = [...table.tHead.rows[0].cells];
  const body = table.tBodies[0];
  headers.forEach((header, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...header.childNodes);
    header.append(button);
    if (!header.hasAttribute("aria-sort")) header.setAttribute("aria-sort", "none");
    button.addEventListener("click", () => {
      const numeric = body.rows[0].cells[column].matches(".number");
      const before = header.getAttribute("aria-sort");
      // Numbers begin with the worst, texts with the first.
      const first = numeric ? "descending" : "ascending";
      const other = numeric ? "ascending" : "descending";
      const order = before === first ? other : first;
      const sign = order === "ascending" ? 1 : -1;
      for (const h of headers) h.setAttribute("aria-sort", h === header ? order : "none");
      const key = (row) => {
        const cell = row.cells[column];
        if (!numeric) return cell.textContent.trim();
        return cell.dataset.value === "" ? null : Number(cell.dataset.value);
      };
      const compare = (a, b) => {
        const [x, y] = [key(a), key(b)];
        if (x === null || y === null) return (x === null) - (y === null); // n/a stays last
        return sign * (numeric ? x - y : x.localeCompare(y, "en", { numeric: true }));
      };
      body.append(...[...body.rows].sort(compare));
    });
  });
}

/** Open what holds the part that a link leads to. */
function reveal() {
  const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  for (let one = target; one; one = one.parentElement) if (one.matches?.("details")) one.open = true;
  if (target) target.scrollIntoView();
}

/** Say in each cell what its column is, for tables whose rows are blocks on narrow screens. */
function labelled(table) {
  const names = [...table.tHead.rows[0].cells].map((cell) => cell.textContent.trim());
  for (const row of table.tBodies[0].rows)
    [...row.cells].forEach((cell, column) => {
      if (cell.tagName === "TD") cell.dataset.label = names[column];
    });
}

/** Fit something to its place now, and whenever that may have another width, or one at all. */
function fitted(act) {
  act();
  addEventListener("resize", act);
  addEventListener("toggle", act, true);
}

/** Draw dots as wide as their place, where that is narrow: names stand above their dots. */
function dotted(plot) {
  const [left, width] = ["left", "width"].map((name) => Number(plot.dataset[name]));
  const { width: breadth, height } = plot.viewBox.baseVal;
  const drawn = plot.innerHTML;
  const edge = 24; // [px], half of a number
  const widen = () => {
    const room = plot.parentElement.clientWidth;
    const total = room < NARROW ? room : breadth;
    if (!room || total === plot.viewBox.baseVal.width) return;
    plot.innerHTML = drawn;
    plot.setAttribute("viewBox", `0 0 ${total} ${height}`);
    plot.classList.toggle("narrow", total < breadth);
    if (total === breadth) return;
    const at = (x) => (edge + ((Number(x) - left) * (total - 2 * edge)) / width).toFixed(1);
    for (const one of plot.children) {
      if (one.getAttribute("text-anchor") === "end") {
        one.setAttribute("text-anchor", "start");
        one.setAttribute("x", 0);
        one.setAttribute("y", Number(one.getAttribute("y")) - 12);
      } else if (one.matches("path")) {
        const path = one.getAttribute("d");
        one.setAttribute("d", path.replace(/([MH])([\d.]+)/g, (_, letter, x) => letter + at(x)));
      } else {
        const name = one.matches("circle") ? "cx" : "x";
        one.setAttribute(name, at(one.getAttribute(name)));
      }
    }
  };
  fitted(widen);
}

/** Bring the page to life; resolves when all figures in view have their samples. */
function start() {
  document.documentElement.classList.add("script");
  document.querySelectorAll("main table").forEach(labelled);
  document.querySelectorAll("table.sortable").forEach(sortable);
  document.querySelectorAll(".dots[data-left]").forEach(dotted);
  const figures = [...document.querySelectorAll("figure.zoomable")].map(zoomable);
  addEventListener("hashchange", reveal);
  addEventListener("beforeprint", () => {
    for (const one of document.querySelectorAll(".printed > details")) one.open = true;
  });
  reveal();
  return Promise.all(figures);
}
