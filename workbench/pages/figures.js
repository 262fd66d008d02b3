const SHORTEST = 200; // [ms] that can be seen at once
const FOLDED = "details:not([open])";
const NARROW = 640; // [px] of a place; below, a figure is drawn as wide as that
const MARGIN = 0.06; // of a fitted panel, above and below its curves

/** Round values between low and high, at most `most` of them. */
function ticks(low, high, most) {
  const rough = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(rough));
  const first = [1, 2, 5, 10].find((factor) => factor * power >= rough);
  let step = power * first;
  // Two marks make an axis.
  if (Math.floor(high / step) - Math.ceil(low / step) < 1) step /= first === 5 ? 2.5 : 2;
  const values = [];
  for (let k = Math.ceil(low / step); k * step <= high; k += 1) values.push(k * step);
  return values.map((value) => [value, String(Number(value.toPrecision(6))).replace("-", "−")]);
}

function zoomable(figure) {
  const plot = figure.querySelector(".plot");
  const place = figure.querySelector(".scroll");
  const [left, wide, bottom, begin, duration] = ["left", "width", "bottom", "begin", "duration"].map(
    (name) => Number(plot.dataset[name]),
  );
  const { width: breadth, height: depth } = plot.viewBox.baseVal;
  let width = wide;
  const { axis, unit: axisUnit } = plot.dataset;
  /** A place on the axis at the bottom, in thousandths after its begin, for people. */
  const placed = (after, digits) => {
    const value = begin + after / 1e3;
    return axisUnit ? `${value.toFixed(digits)} ${axisUnit}` : `${axis} ${value.toFixed(0)}`;
  };
  const words = new Map(
    [...figure.querySelectorAll(".legend li")].map((one) => [
      one.dataset.style,
      one.textContent.trim().split(" (")[0], // without what follows in brackets
    ]),
  );
  const panels = [...plot.querySelectorAll(".axes")].map((axes) => {
    const view = axes.querySelector(".panel");
    const [top, height, low, high] = ["top", "height", "low", "high"].map((name) =>
      Number(axes.dataset[name]),
    );
    const grid = axes.querySelector(".grid");
    const bands = [...view.querySelectorAll(".band")];
    const lines = [...view.querySelectorAll(".curve")];
    const further = axes.dataset.further && [axes.dataset.further, Number(axes.dataset.factor)];
    const { unit } = axes.dataset;
    const heading = axes.querySelector(".title");
    const title = heading.textContent;
    const beside = axes.querySelector(":scope > .further");
    const levels = view.viewBox.baseVal.height;
    return { view, grid, top, height, low, high, levels, bands, lines, unit, further, title, heading, beside, curves: null };
  });
  const times = plot.querySelector(".time");
  const range = document.createElement("output");
  let [from, to] = [0, duration]; // [ms] after the begin
  let all = null; // samples, once they are unpacked

  /** Curves of a panel in its levels: from the samples, or from what is drawn. */
  function curves(panel) {
    panel.curves ??= panel.lines.map((line) => ({ line, ...points(line) }));
    return panel.curves;
  }

  function load({ xs, curves: sampled }) {
    let next = 0;
    for (const panel of panels) {
      const level = (value) => ((panel.high - value) * panel.levels) / (panel.high - panel.low);
      let band = 0;
      panel.curves = panel.lines.map((line) => {
        const { values, reach } = sampled[next++];
        const drawn = reach?.some((one) => !Number.isNaN(one)) ? panel.bands[band++] : undefined;
        const upper = drawn && values.map((value, i) => level(value + reach[i]));
        const lower = drawn && values.map((value, i) => level(value - reach[i]));
        return { line, xs, ys: values.map(level), values, reach, band: drawn, upper, lower };
      });
    }
    all = xs;
    draw();
  }
  const ready = shown(figure)
    .then(() => samples(figure, plot))
    .then((unpacked) => unpacked && load(unpacked));

  /** Upper and lower edge that fit the visible curves, within the panel's own range. */
  function fit(panel) {
    if (to - from >= duration) return [0, panel.levels];
    let [upper, lower] = [panel.levels, 0];
    for (const { line, xs, ys } of curves(panel)) {
      if (line.style.display === "none") continue;
      // A point beside the view draws the line that enters it.
      const first = Math.max(found(xs, from) - 1, 0);
      for (let i = first; i < xs.length && (i === first || xs[i - 1] <= to); i += 1) {
        if (Number.isNaN(ys[i])) continue;
        const y = Math.min(Math.max(ys[i], 0), panel.levels);
        upper = Math.min(upper, y);
        lower = Math.max(lower, y);
      }
    }
    if (lower < upper) return [0, panel.levels];
    const room = Math.max(MARGIN * (lower - upper), 0.005 * panel.levels);
    return [upper - room, lower + room];
  }

  /** Draw the curves of a panel anew, from all samples in view. */
  function redraw(panel) {
    if (!all) return;
    const first = Math.max(found(all, from) - 1, 0);
    const last = Math.min(found(all, to), all.length - 1);
    const x = (i) => all[i];
    for (const { line, ys, band, upper, lower } of panel.curves) {
      line.setAttribute("d", path(outline(ys, first, last, width), x, (i) => ys[i]));
      if (!band) continue;
      const indices = outline(upper, first, last, width / 4).filter((i) => !Number.isNaN(upper[i]));
      const edges = path(indices, x, (i) => upper[i]);
      const back = path(indices.reverse(), x, (i) => lower[i]).replace("M", "L");
      band.setAttribute("d", edges && `${edges}${back}z`);
    }
  }

  function draw() {
    const at = (time) => (left + (width * (1e3 * (time - begin) - from)) / (to - from)).toFixed(1);
    const vertical = ticks(begin + from / 1e3, begin + to / 1e3, Math.ceil((12 * width) / wide));
    for (const panel of panels) {
      const [upper, lower] = fit(panel);
      panel.view.setAttribute("viewBox", `${from} ${upper} ${to - from} ${lower - upper}`);
      redraw(panel);
      const value = (level) => panel.high - ((panel.high - panel.low) * level) / panel.levels;
      const [high, low] = [value(upper), value(lower)];
      const most = Math.max(3, Math.floor(panel.height / 28));
      const marks = (factor) =>
        ticks(low * factor, high * factor, most).map(([v, text]) => [
          panel.top + (panel.height * (high - v / factor)) / (high - low),
          text,
        ]);
      panel.grid.innerHTML =
        marks(1)
          .map(
            ([y, text]) =>
              `<path d="M${left} ${y.toFixed(1)}h${width}"/><text x="${left - 6}" y="${(y + 4).toFixed(1)}" text-anchor="end">${text}</text>`,
          )
          .join("") +
        vertical.map(([t]) => `<path d="M${at(t)} ${panel.top}v${panel.height}"/>`).join("") +
        (panel.further ? marks(panel.further[1]) : [])
          .map(([y, text]) => `<text class="further" x="${left + width + 5}" y="${(y + 4).toFixed(1)}">${text}</text>`)
          .join("");
    }
    times.innerHTML = vertical
      .map(([t, text]) => `<text x="${at(t)}" y="${bottom + 16}" text-anchor="middle">${text}</text>`)
      .join("");
    range.value = `${placed(from, 2)} to ${placed(to, 2)}`;
    if (read !== null) point(read);
  }

  // --- narrow screens ---

  const notes = document.createElement("p");
  notes.className = "note";
  notes.hidden = true;
  place.after(notes);

  /** A title that fits; one that does not is cut at its first comma or colon, and stands below the figure. */
  function head({ heading, title }, total) {
    heading.textContent = title;
    heading.setAttribute("x", left);
    if (total === breadth || heading.getComputedTextLength() <= total - left) return "";
    heading.setAttribute("x", 0);
    if (heading.getComputedTextLength() <= total) return "";
    heading.textContent = title.split(/[,:] /)[0];
    return title;
  }

  /** Draw the figure as wide as its place is, with letters as large as ever. */
  function widen() {
    const room = place.clientWidth;
    const total = room < NARROW ? room : breadth;
    if (!room || total === plot.viewBox.baseVal.width) return;
    const right = total === breadth || panels.some(({ further }) => further) ? breadth - left - wide : 8;
    width = total - left - right;
    plot.setAttribute("viewBox", `0 0 ${total} ${depth}`);
    plot.classList.toggle("narrow", total < breadth);
    for (const { view, beside } of panels) {
      view.setAttribute("width", width);
      beside?.setAttribute("x", total);
    }
    const cut = panels.map((panel) => head(panel, total)).filter(Boolean);
    notes.textContent = cut.join("; ");
    notes.hidden = !cut.length;
    plot.querySelector(".axis").setAttribute("x", left + width / 2);
    draw();
  }

  // --- reading values ---

  let read = null; // sample that is read
  const cursor = document.createElementNS("http://www.w3.org/2000/svg", "path");
  cursor.setAttribute("class", "cursor");
  const box = document.createElement("div");
  box.className = "readout";
  box.hidden = true;
  const spoken = document.createElement("output");
  spoken.className = "unseen";

  const digits = (value) => String(Number(value.toPrecision(5))).replace("-", "−");
  function said(panel, value, reach) {
    const { unit, further } = panel;
    const own = `${digits(value)}${reach > 0 ? ` ± ${digits(Number(reach.toPrecision(2)))}` : ""}`;
    const beside = further ? ` (${digits(Number((value * further[1]).toPrecision(4)))} ${further[0]})` : "";
    return `${own}${unit === "1" ? "" : ` ${unit}`}${beside}`;
  }

  /** Values of all visible curves at a sample, by panel. */
  function values(sample) {
    return panels.map((panel) => {
      const entries = [];
      for (const one of panel.curves) {
        const value = one.values[sample];
        if (one.line.style.display === "none" || Number.isNaN(value)) continue;
        const { style } = one.line.dataset;
        const reach = one.reach ? one.reach[sample] : NaN;
        const dashed = one.line.classList.contains("dashed") ? ", dashed" : "";
        const name = `${words.get(style) ?? ""}${dashed}`;
        entries.push({ style, name, text: said(panel, value, reach) });
      }
      return { title: panel.title, entries };
    });
  }

  function point(sample) {
    read = sample;
    const x = left + (width * (all[sample] - from)) / (to - from);
    const time = placed(all[sample], 3);
    cursor.setAttribute("d", `M${x.toFixed(1)} ${panels[0].top}V${bottom}`);
    cursor.style.display = x < left || x > left + width ? "none" : "";
    box.replaceChildren();
    const head = document.createElement("b");
    head.textContent = time;
    box.append(head);
    for (const { title, entries } of values(sample)) {
      if (!entries.length) continue;
      const name = document.createElement("p");
      name.textContent = title;
      box.append(name);
      for (const { style, name: who, text } of entries) {
        const entry = document.createElement("div");
        entry.className = `style-${style}`;
        entry.textContent = `${text}  ${who}`;
        box.append(entry);
      }
    }
    box.hidden = false;
    const scale = plot.getBoundingClientRect().width / plot.viewBox.baseVal.width;
    const right = x > left + width / 2;
    box.style.left = right ? "" : `${x * scale + 12}px`;
    box.style.right = right ? `${place.clientWidth - x * scale + 12}px` : "";
  }

  function speak() {
    const time = placed(all[read], 3);
    const told = values(read).filter(({ entries }) => entries.length);
    spoken.value = [
      time,
      ...told.map(({ title, entries }) => `${title}: ${entries.map((e) => `${e.name} ${e.text}`).join(", ")}`),
    ].join("; ");
  }

  function hide() {
    read = null;
    box.hidden = true;
    cursor.style.display = "none";
  }

  /** Read the sample so many after the one that is read, or the middle one. */
  function step(count) {
    if (!all) return;
    const middle = found(all, (from + to) / 2);
    const sample = read === null ? middle : read + count;
    read = Math.min(Math.max(sample, 0), all.length - 1);
    if (all[read] < from || all[read] > to) show(all[read] - (to - from) / 2, to - from);
    point(read);
    speak();
  }
  const stride = () => Math.max(1, Math.round((found(all, to) - found(all, from)) / 50));

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

  const everything = axisUnit === "s" ? "Whole recording" : "All";
  const actions = [
    ["+", "Zoom in", () => zoom(0.5), ["+", "="]],
    ["−", "Zoom out", () => zoom(2), ["-"]],
    ["←", "Earlier", () => move(-0.25), ["ArrowLeft"]],
    ["→", "Later", () => move(0.25), ["ArrowRight"]],
    [everything, everything, whole, ["0", "Home"]],
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
  plot.append(cursor);
  place.append(box, spoken);
  place.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const action = actions.find(([, , , keys]) => keys.includes(event.key));
    const way = { ",": -1, ".": 1, "<": -1, ";": -1, ">": 1, ":": 1 }[event.key];
    if (event.key === "Escape" && read !== null) hide();
    else if (way) step(way * (event.shiftKey && all ? stride() : 1));
    else if (action) action[2]();
    else return;
    event.preventDefault();
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
  plot.addEventListener("pointermove", (event) => {
    const time = pointed(event);
    if (all && time >= from && time <= to) point(Math.min(found(all, time), all.length - 1));
    else if (all) hide();
  });
  plot.addEventListener("pointerleave", hide);
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
    entry.append(button);
    const reveal = (shown) => {
      button.setAttribute("aria-pressed", String(shown));
      for (const path of plot.querySelectorAll(`path[data-style="${entry.dataset.style}"]`)) {
        path.style.display = shown ? "" : "none";
      }
    };
    reveal(entry.dataset.hidden === undefined);
    button.addEventListener("click", () => {
      reveal(button.getAttribute("aria-pressed") === "false");
      draw();
    });
  }
  range.value = "whole recording";
  fitted(widen);
  return figure.closest(FOLDED) ? null : ready;
}
