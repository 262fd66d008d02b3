/** Points of a path that consists of M x y l dx dy ..., where there are no samples. */
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
  return { xs, ys };
}

/** Channels of samples as they were packed: see packing.py. */
async function unpacked(text, count) {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer());
  const half = planes.length / 2;
  const channels = [];
  for (let start = 0; start < half; start += count) {
    const codes = new Uint16Array(count);
    let code = 0;
    for (let i = 0; i < count; i += 1) {
      const folded = planes[start + i] | (planes[half + start + i] << 8);
      codes[i] = code += (folded >> 1) ^ -(folded & 1);
    }
    channels.push(codes);
  }
  return channels;
}

const ABSENT = 65535; // code of a sample without a value
const valued = (codes, [low, high]) =>
  Float64Array.from(codes, (code) => (code === ABSENT ? NaN : low + ((high - low) * code) / (ABSENT - 1)));

/** Times [ms] after the first sample, and by curve its values and halves of bands. */
async function samples(figure, plot) {
  const text = figure.querySelector(".samples")?.textContent;
  if (!text || !("DecompressionStream" in window)) return null;
  const told = JSON.parse(plot.dataset.told);
  const [upper, lower, ...rest] = await unpacked(text, told.samples);
  const duration = Number(plot.dataset.duration);
  const xs = Float64Array.from(upper, (high, i) => ((high * 65536 + lower[i]) * duration) / 4294967295);
  const curves = told.curves.map((ranges) => {
    const [values, reach] = ranges.map((range) => valued(rest.shift(), range));
    return { values, reach };
  });
  return { xs, curves };
}

/** Resolves when a figure is not, or no longer, folded away. */
function shown(figure) {
  const folded = figure.closest(FOLDED);
  if (!folded) return Promise.resolve();
  return new Promise((resolve) => folded.addEventListener("toggle", resolve, { once: true }));
}

/** First index whose time is not before t. */
function found(xs, t) {
  let [low, high] = [0, xs.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (xs[middle] < t) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** Indices from first to last, at most four for each of `columns`: ends and extremes, none lost. */
function outline(ys, first, last, columns) {
  const size = Math.max(1, Math.ceil((last - first + 1) / columns));
  if (size <= 4) return Array.from({ length: last - first + 1 }, (_, i) => first + i);
  const kept = [];
  for (let start = first; start <= last; start += size) {
    const end = Math.min(start + size - 1, last);
    let [least, most, gap] = [start, start, -1];
    for (let i = start; i <= end; i += 1) {
      if (Number.isNaN(ys[i])) gap = i;
      if (!(ys[i] >= ys[least])) least = i;
      if (!(ys[i] <= ys[most])) most = i;
    }
    kept.push(...new Set([start, least, most, end].concat(gap < 0 ? [] : [gap]).sort((a, b) => a - b)));
  }
  return kept;
}

/** A path through points, broken where there is none. */
function path(indices, x, y) {
  let text = "";
  let pen = "M";
  for (const i of indices) {
    const value = y(i);
    if (Number.isNaN(value)) pen = "M";
    else {
      text += `${pen}${x(i).toFixed(2)} ${value.toFixed(2)}`;
      pen = "L";
    }
  }
  return text;
}
