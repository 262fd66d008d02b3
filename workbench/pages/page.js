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

/** Draw something anew as wide as its place, where that is narrow: `place` puts each part. */
function narrowed(plot, height, place) {
  const { width: breadth, height: depth } = plot.viewBox.baseVal;
  const drawn = plot.innerHTML;
  fitted(() => {
    const room = plot.parentElement.clientWidth;
    const total = room < Math.min(NARROW, breadth) ? room : breadth;
    if (!room || total === plot.viewBox.baseVal.width) return;
    const narrow = total < breadth;
    plot.innerHTML = drawn;
    plot.setAttribute("viewBox", `0 0 ${total} ${narrow ? height : depth}`);
    plot.classList.toggle("narrow", narrow);
    if (narrow) place(total);
  });
}

/** Dots and curves: what stood beside them stands above. */
function dotted(plot) {
  const [left, width] = ["left", "width"].map((name) => Number(plot.dataset[name]));
  const edge = 24; // [px], half of a number
  narrowed(plot, plot.viewBox.baseVal.height, (total) => {
    const at = (x) => (edge + ((Number(x) - left) * (total - 2 * edge)) / width).toFixed(1);
    for (const one of plot.children) {
      const x = Number(one.getAttribute("x"));
      if (one.getAttribute("text-anchor") === "end" && x < left) {
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
  });
}

/** A matrix: names stand above their rows, and columns have the numbers of the rows. */
function numbered(plot) {
  const [left, cell] = ["left", "cell"].map((name) => Number(plot.dataset[name]));
  const count = Math.round((plot.viewBox.baseVal.width - left) / cell);
  const head = 16; // [px] of the numbers above
  narrowed(plot, head + count * cell, (total) => {
    const wide = total / count;
    const down = (y) => Number(y) - left + head + cell / 2; // of the cells of a row
    let [rows, columns] = [0, 0];
    for (const one of [...plot.children]) {
      const [x, y] = ["x", "y"].map((name) => Number(one.getAttribute(name)));
      const begin = Math.floor((x - left) / cell) * wide;
      if (one.hasAttribute("transform")) {
        one.removeAttribute("transform");
        one.classList.add("value");
        one.textContent = columns += 1;
        one.setAttribute("text-anchor", "middle");
        one.setAttribute("x", (columns - 0.5) * wide);
        one.setAttribute("y", head - 4);
      } else if (one.getAttribute("text-anchor") === "end") {
        one.textContent = `${(rows += 1)} ${one.textContent}`;
        one.setAttribute("text-anchor", "start");
        one.setAttribute("x", 0);
        one.setAttribute("y", down(y) - cell + 6);
      } else if (one.matches("path")) {
        const top = down(one.getAttribute("d").match(/ ([\d.]+)H/)[1]);
        one.setAttribute("d", `M1 ${top}H${total - 1}v${cell / 2}H1z`);
      } else if (one.matches("rect")) {
        for (const [name, value] of [["x", begin], ["y", down(y)], ["width", wide - 1], ["height", cell / 2 - 1]])
          one.setAttribute(name, value);
      } else {
        one.setAttribute("x", begin + wide / 2);
        one.setAttribute("y", down(y) - cell / 4);
        const fits = Math.min(10, (10 * wide) / one.getComputedTextLength()); // [px], 10 is usual
        one.style.fontSize = `${fits}px`;
      }
    }
  });
}

/** Bring the page to life; resolves when all figures in view have their samples. */
function start() {
  document.documentElement.classList.add("script");
  document.querySelectorAll("main table").forEach(labelled);
  document.querySelectorAll("table.sortable").forEach(sortable);
  document.querySelectorAll(".dots[data-left]").forEach(dotted);
  document.querySelectorAll(".matrix").forEach(numbered);
  const figures = [...document.querySelectorAll("figure.zoomable")].map(zoomable);
  addEventListener("hashchange", reveal);
  addEventListener("beforeprint", () => {
    for (const one of document.querySelectorAll(".printed > details")) one.open = true;
  });
  reveal();
  return Promise.all(figures);
}
