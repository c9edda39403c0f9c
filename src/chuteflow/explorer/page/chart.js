// Charts as SVG: axes, areas, lines, marks. Everything is redrawn at each change.
import { escaped, sizeOf } from "./page.js";

/** A number with so many digits, without needless zeros. */
export function number(value, digits = 4) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) return value.toExponential(Math.max(0, digits - 2)).replace("e+", "e");
  return String(Number(value.toPrecision(digits)));
}

function logTicks(low, high, most) {
  const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9);
  const step = Math.max(1, Math.ceil((last - first + 1) / most));
  const decades = [];
  for (let k = first; k <= last; k += step) decades.push(10 ** k);
  if (decades.length > 2) return decades;
  const parts = [];
  for (let k = first - 1; k <= last; k++) for (const m of [1, 2, 3, 5, 7]) {
    const v = m * 10 ** k;
    if (v >= low * 0.999 && v <= high * 1.001) parts.push(v);
  }
  if (parts.length < 2) return null;
  return parts.length > most ? parts.filter((_, i) => i % Math.ceil(parts.length / most) === 0) : parts;
}

/** The axis, or a default in place of one that has no extent. */
function drawable(axis) {
  const { low, high, log } = axis;
  const possible = Number.isFinite(low) && Number.isFinite(high) && high - low > 1e-9 * Math.abs(high) && !(log && low <= 0);
  return possible ? axis : { ...axis, low: 1, high: 10 };
}

function ticks({ low, high, log }, most) {
  const logarithmic = log && logTicks(low, high, most);
  if (logarithmic) return logarithmic;
  const raw = (high - low) / most, unit = 10 ** Math.floor(Math.log10(raw));
  const step = unit * [1, 2, 5, 10].find((m) => m * unit >= raw);
  const out = [];
  for (let v = Math.ceil(low / step - 1e-9) * step; v <= high + 1e-9 * step; v += step) out.push(Math.abs(v) < 1e-9 * step ? 0 : v);
  return out;
}

function scale({ low, high, log }, from, to) {
  const f = log ? Math.log : (v) => v;
  const start = f(low), span = f(high) - start || 1;
  const at = (v) => from + ((f(v) - start) / span) * (to - from);
  at.inverse = (pixel) => {
    const v = start + ((pixel - from) / (to - from)) * span;
    return log ? Math.exp(v) : v;
  };
  return at;
}

const known = ([a, b]) => Number.isFinite(a) && Number.isFinite(b);

const shortly = (v) => v.toFixed(1);

/** A line through points; a smooth one has cubics between them, whose tangents are parallel to the chords of the neighbours. */
function path(points, sx, sy, smooth = false) {
  const placed = points.map(([a, b]) => [sx(a), sy(b)]).filter(known);
  const near = (i, from, sign) => {
    const [before, after] = [placed[Math.max(0, i - 1)], placed[Math.min(placed.length - 1, i + 1)]];
    return from.map((v, k) => shortly(v + (sign * (after[k] - before[k])) / 6)).join(" ");
  };
  const curved = (here, i) => `C${near(i - 1, placed[i - 1], 1)} ${near(i, here, -1)} ${here.map(shortly).join(" ")}`;
  return placed.map((here, i) => (i && smooth ? curved(here, i) : `${i ? "L" : "M"}${here.map(shortly).join(" ")}`)).join("");
}

/** A label as SVG markup: what follows "_" is a subscript. */
const subscripted = (label) => escaped(label).replace(/_(\w+)(.*)/, '<tspan dy="3" font-size="9">$1</tspan><tspan dy="-3">$2</tspan>');

/** Markers, as the beginning of an element whose title and end follow. */
const shapes = {
  circle: (x, y) => `<circle class="special" cx="${x}" cy="${y}" r="4.5">`,
  diamond: (x, y) => `<path class="special" d="M${x} ${y - 5.5}l5.5 5.5l-5.5 5.5l-5.5-5.5z">`,
  triangle: (x, y) => `<path class="special" d="M${x - 5} ${y - 4}h10l-5 9z">`,
  bar: (x, y) => `<path class="limit" d="M${x} ${y - 7}v14">`,
  unstable: (x, y) => `<path class="stability-mark unstable" d="M${x - 4} ${y - 4}l8 8m-8 0l8-8">`,
  stable: (x, y) => `<path class="stability-mark stable" d="M${x - 4} ${y - 4}h8v8h-8z">`,
  unknown: (x, y) => `<text class="stability-mark unknown" x="${x}" y="${y + 4}" text-anchor="middle">?`,
  pin: (x, y, { letter }) => `<g class="pin"><path d="M${x - 5} ${y - 5}h10v10h-10z"/><text x="${x - 8}" y="${y - 7}">${letter}</text>`,
  dot: (x, y, mark) => `<circle class="dot" data-flow="${mark.flow}" cx="${x}" cy="${y}" r="${mark.chosen ? 8 : 6}" fill="${mark.colour}">`,
};

/** Marks of what was measured. */
const measuredShapes = {
  circle: (x, y) => `<circle cx="${x}" cy="${y}" r="3"/>`,
  diamond: (x, y) => `<path d="M${x} ${y - 4}l4 4l-4 4l-4-4z"/>`,
  triangle: (x, y) => `<path d="M${x - 3.5} ${y - 3}h7l-3.5 6z"/>`,
};

function axes(x, y, sx, sy, { l, r, t, b }, height, levels) {
  const out = [];
  for (const v of ticks(x, Math.max(2, (r - l) / 62))) {
    const p = sx(v).toFixed(1);
    out.push(`<path class="grid" d="M${p} ${t}V${b}"/><text x="${p}" y="${b + 14}" text-anchor="middle">${number(v, 3)}</text>`);
  }
  for (const v of levels) {
    const p = sy(v).toFixed(1);
    out.push(`<path class="grid" d="M${l} ${p}H${r}"/>`);
    if (!y.bare) out.push(`<text x="${l - 5}" y="${Number(p) + 4}" text-anchor="end">${number(v, 3)}</text>`);
  }
  out.push(`<path class="axis" d="M${l} ${t}V${b}H${r}"/>`);
  out.push(`<text x="${(l + r) / 2}" y="${height - 5}" text-anchor="middle">${subscripted(x.label)}</text>`);
  if (y.label) out.push(`<text transform="translate(12 ${(t + b) / 2}) rotate(-90)" text-anchor="middle">${subscripted(y.label)}</text>`);
  return out.join("");
}

/**
 * Draw into `svg`, without what cannot be placed; returns the scales `sx`, `sy` and the frame `box`.
 *
 * `x` and `y`: {low, high, log, label}, `y.bare` without numbers. `areas`: {rings, colour}, hatched without a
 * colour. `points`: {x, y, across, up (errors), shape, colour, title}, beneath all lines. `lines`: {points, colour, dash, width, beneath, smooth}. `marks`: {x, y, shape, title, and of a "dot" flow, colour, chosen}. `hair`: x of a line up.
 */
export function draw(svg, { x: across, y: up, areas = [], points: measured = [], lines = [], marks = [], hair }) {
  const x = drawable(across), y = drawable(up);
  const { width, height } = sizeOf(svg);
  const levels = ticks(y, Math.max(2, (height - 46) / 44));
  // Space for the numbers, of some 6.6 pixels a digit, and for the label.
  const digits = y.bare ? 0 : Math.max(...levels.map((v) => number(v, 3).length));
  const box = { l: Math.round(digits * 6.6) + (y.label ? 28 : 12), r: width - 10, t: 10, b: height - 36 };
  const sx = scale(x, box.l, box.r), sy = scale(y, box.b, box.t);
  const inside = [];
  for (const { rings, colour } of areas) {
    const paint = colour ? `fill="${colour}" stroke="${colour}"` : `class="unknown" fill="url(#${svg.id}-hatch)"`;
    inside.push(`<path d="${rings.map((points) => `${path(points, sx, sy)}z`).join("")}" ${paint} stroke-width=".7"/>`);
  }
  for (const point of measured.filter((one) => known([sx(one.x), sy(one.y)]))) {
    const [px, py, l, r, t, b] = [sx(point.x), sy(point.y), sx(point.x - (point.across ?? 0)), sx(point.x + (point.across ?? 0)), sy(point.y + (point.up ?? 0)), sy(point.y - (point.up ?? 0))].map((v) => (Number.isFinite(v) ? v.toFixed(1) : "0"));
    inside.push(`<g class="measured" stroke="${point.colour}"><path d="M${l} ${py}H${r}M${px} ${t}V${b}"/>${measuredShapes[point.shape](Number(px), Number(py))}<title>${escaped(point.title)}</title></g>`);
  }
  for (const { points, colour, dash, width: thick = 2, beneath, smooth } of lines) {
    inside.push(`<path class="${beneath ? "beneath" : "line"}" stroke="${colour}" d="${path(points, sx, sy, smooth)}"${dash ? ` stroke-dasharray="${dash}"` : ""} stroke-width="${thick}"/>`);
  }
  if (known([sx(hair), 0])) inside.push(`<path class="hair" d="M${sx(hair).toFixed(1)} ${box.t}V${box.b}"/>`);
  for (const mark of marks.filter((one) => known([sx(one.x), sy(one.y)]))) {
    const shape = shapes[mark.shape](Number(sx(mark.x).toFixed(1)), Number(sy(mark.y).toFixed(1)), mark);
    inside.push(`${shape}<title>${escaped(mark.title)}</title></${shape.match(/\w+/)[0]}>`);
  }
  svg.innerHTML = `<pattern id="${svg.id}-hatch" class="hatch" width="7" height="7" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><path d="M3 0V7"/></pattern>
    <clipPath id="${svg.id}-clip"><rect x="${box.l - 8}" y="${box.t - 8}" width="${Math.max(0, box.r - box.l + 16)}" height="${box.b - box.t + 8}"/></clipPath>
    ${axes(x, y, sx, sy, box, height, levels)}<g clip-path="url(#${svg.id}-clip)">${inside.join("")}</g>`;
  return { sx, sy, box };
}
