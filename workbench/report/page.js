"use strict";

const SHORTEST = 200; // [ms] that can be seen at once
const MARGIN = 0.06; // of a fitted panel, above and below its curves

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

/** Round values between low and high, at most `most` of them. */
function ticks(low, high, most) {
  const rough = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
  const values = [];
  for (let k = Math.ceil(low / step); k * step <= high; k += 1) values.push(k * step);
  return values.map((value) => [value, String(Number(value.toPrecision(6))).replace("-", "−")]);
}

/** Points of a path that consists of M x y l dx dy ... */
function points(path) {
  const xs = [];
  const ys = [];
  for (const part of path.getAttribute("d").split("M").slice(1)) {
    const numbers = part.match(/-?\d+/g).map(Number);
    let [x, y] = [0, 0];
    for (let i = 0; i < numbers.length; i += 2) {
      xs.push((x += numbers[i]));
      ys.push((y += numbers[i + 1]));
    }
  }
  return { path, xs, ys };
}

function zoomable(figure) {
  const plot = figure.querySelector(".plot");
  const place = figure.querySelector(".scroll");
  const [left, width, bottom, begin, duration] = ["left", "width", "bottom", "begin", "duration"].map(
    (name) => Number(plot.dataset[name]),
  );
  const panels = [...plot.querySelectorAll(".axes")].map((axes) => {
    const view = axes.querySelector(".panel");
    const [top, height, low, high] = ["top", "height", "low", "high"].map((name) =>
      Number(axes.dataset[name]),
    );
    const grid = axes.querySelector(".grid");
    return { view, grid, top, height, low, high, levels: view.viewBox.baseVal.height, curves: null };
  });
  const times = plot.querySelector(".time");
  const range = document.createElement("output");
  let [from, to] = [0, duration]; // [ms] after the begin

  /** Upper and lower edge that fit the visible curves, within the panel's own range. */
  function fit(panel) {
    if (to - from >= duration) return [0, panel.levels];
    panel.curves ??= [...panel.view.querySelectorAll(".curve")].map(points);
    let [upper, lower] = [panel.levels, 0];
    for (const { path, xs, ys } of panel.curves) {
      if (path.style.display === "none") continue;
      for (let i = 0; i < xs.length; i += 1) {
        // A point beside the view draws the line that enters it.
        if ((xs[i + 1] ?? xs[i]) < from || (xs[i - 1] ?? xs[i]) > to) continue;
        const y = Math.min(Math.max(ys[i], 0), panel.levels);
        upper = Math.min(upper, y);
        lower = Math.max(lower, y);
      }
    }
    if (lower < upper) return [0, panel.levels];
    const room = Math.max(MARGIN * (lower - upper), 0.005 * panel.levels);
    return [upper - room, lower + room];
  }

  function draw() {
    const at = (time) => (left + (width * (1e3 * (time - begin) - from)) / (to - from)).toFixed(1);
    const vertical = ticks(begin + from / 1e3, begin + to / 1e3, 12);
    for (const panel of panels) {
      const [upper, lower] = fit(panel);
      panel.view.setAttribute("viewBox", `${from} ${upper} ${to - from} ${lower - upper}`);
      const value = (level) => panel.high - ((panel.high - panel.low) * level) / panel.levels;
      const [high, low] = [value(upper), value(lower)];
      panel.grid.innerHTML =
        ticks(low, high, Math.max(3, Math.floor(panel.height / 28)))
          .map(([v, text]) => {
            const y = panel.top + (panel.height * (high - v)) / (high - low);
            return `<path d="M${left} ${y.toFixed(1)}h${width}"/><text x="${left - 6}" y="${(y + 4).toFixed(1)}" text-anchor="end">${text}</text>`;
          })
          .join("") +
        vertical.map(([t]) => `<path d="M${at(t)} ${panel.top}v${panel.height}"/>`).join("");
    }
    times.innerHTML = vertical
      .map(([t, text]) => `<text x="${at(t)}" y="${bottom + 16}" text-anchor="middle">${text}</text>`)
      .join("");
    const seconds = (ms) => (begin + ms / 1e3).toFixed(2);
    range.value = `${seconds(from)} to ${seconds(to)} s`;
  }

  function show(start, length) {
    const span = Math.min(Math.max(length, Math.min(SHORTEST, duration)), duration);
    from = Math.min(Math.max(start, 0), duration - span);
    to = from + span;
    draw();
  }
  const zoom = (factor, centre = (from + to) / 2) =>
    show(centre - (centre - from) * factor, (to - from) * factor);
  const move = (share) => show(from + share * (to - from), to - from);
  const whole = () => show(0, duration);

  const actions = [
    ["+", "Zoom in", () => zoom(0.5), ["+", "="]],
    ["−", "Zoom out", () => zoom(2), ["-"]],
    ["←", "Earlier", () => move(-0.25), ["ArrowLeft"]],
    ["→", "Later", () => move(0.25), ["ArrowRight"]],
    ["Whole recording", "Whole recording", whole, ["0", "Home"]],
  ];
  const tools = document.createElement("div");
  tools.className = "tools";
  for (const [text, name, act] of actions) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = text;
    button.title = name;
    button.setAttribute("aria-label", name);
    button.addEventListener("click", act);
    tools.append(button);
  }
  tools.append(range);
  place.before(tools);
  place.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const action = actions.find(([, , , keys]) => keys.includes(event.key));
    if (!action) return;
    event.preventDefault();
    action[2]();
  });

  /** Time [ms] below the pointer. */
  function pointed(event) {
    const box = plot.getBoundingClientRect();
    const x = ((event.clientX - box.left) * plot.viewBox.baseVal.width) / box.width;
    return from + ((x - left) / width) * (to - from);
  }
  place.addEventListener(
    "wheel",
    (event) => {
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      zoom(1.002 ** event.deltaY, Math.min(Math.max(pointed(event), from), to));
    },
    { passive: false },
  );
  plot.addEventListener("dblclick", whole);
  plot.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    const start = pointed(event);
    const selections = event.shiftKey ? [] : panels.map(({ view, levels }) => {
      const rect = document.createElementNS("http://www.w3.org/2000/svg", "rect");
      rect.setAttribute("class", "selection");
      rect.setAttribute("y", -levels);
      rect.setAttribute("height", 3 * levels);
      view.append(rect);
      return rect;
    });
    let end = start;
    const drag = (now) => {
      if (event.shiftKey) {
        show(from + start - pointed(now), to - from);
        return;
      }
      end = Math.min(Math.max(pointed(now), from), to);
      for (const rect of selections) {
        rect.setAttribute("x", Math.min(start, end));
        rect.setAttribute("width", Math.abs(end - start));
      }
    };
    const finish = (now) => {
      plot.removeEventListener("pointermove", drag);
      for (const name of ["pointerup", "pointercancel"]) plot.removeEventListener(name, finish);
      for (const rect of selections) rect.remove();
      // A click, or a finger that began to scroll, is no selection.
      const meant = Math.abs(end - start) > 0.01 * (to - from);
      if (now.type === "pointerup" && meant) show(Math.min(start, end), Math.abs(end - start));
    };
    plot.setPointerCapture(event.pointerId);
    plot.addEventListener("pointermove", drag);
    for (const name of ["pointerup", "pointercancel"]) plot.addEventListener(name, finish);
  });

  for (const entry of figure.querySelectorAll(".legend li")) {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...entry.childNodes);
    button.setAttribute("aria-pressed", "true");
    entry.append(button);
    button.addEventListener("click", () => {
      const shown = button.getAttribute("aria-pressed") === "false";
      button.setAttribute("aria-pressed", String(shown));
      for (const path of plot.querySelectorAll(`path[data-style="${entry.dataset.style}"]`)) {
        path.style.display = shown ? "" : "none";
      }
      draw();
    });
  }
  range.value = "whole recording";
}

document.documentElement.classList.add("script");
document.querySelectorAll("table.sortable").forEach(sortable);
document.querySelectorAll("figure.zoomable").forEach(zoomable);
