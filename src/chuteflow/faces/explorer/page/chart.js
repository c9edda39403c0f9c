// Charts as SVG: axes, lines that may fold back, marks. Everything is redrawn at each change; it is small.

const text = (s) => String(s).replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);

export function number(value, digits = 4) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) return value.toExponential(Math.max(0, digits - 2)).replace("e+", "e");
  return String(Number(value.toPrecision(digits)));
}

function ticks(low, high, log, room) {
  if (log) {
    const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9);
    const step = Math.max(1, Math.ceil((last - first + 1) / room));
    const decades = [];
    for (let k = first; k <= last; k += step) decades.push(10 ** k);
    if (decades.length > 2) return decades;
    const out = [];
    for (let k = first - 1; k <= last; k++) for (const m of [1, 2, 3, 5, 7]) {
      const v = m * 10 ** k;
      if (v >= low * 0.999 && v <= high * 1.001) out.push(v);
    }
    if (out.length >= 2) return out.length > room ? out.filter((_, i) => i % Math.ceil(out.length / room) === 0) : out;
  }
  const raw = (high - low) / room, unit = 10 ** Math.floor(Math.log10(raw));
  const step = unit * [1, 2, 5, 10].find((m) => m * unit >= raw);
  const out = [];
  for (let v = Math.ceil(low / step - 1e-9) * step; v <= high + 1e-9 * step; v += step) out.push(Math.abs(v) < 1e-9 * step ? 0 : v);
  return out;
}

function scale(axis, from, to) {
  const f = axis.log ? Math.log : (v) => v;
  const low = f(axis.low), high = f(axis.high), span = high - low || 1;
  const at = (v) => from + ((f(v) - low) / span) * (to - from);
  at.inverse = (pixel) => { const v = low + ((pixel - from) / (to - from)) * span; return axis.log ? Math.exp(v) : v; };
  return at;
}

/** Draw into `svg`; returns the scales. `lines`: {points, colour, dash, chosen}; `marks`: {x, y, shape, title, …}. */
export function draw(svg, { x, y, lines = [], marks = [], hair = null, left = 52 }) {
  const width = svg.clientWidth || 300, height = svg.clientHeight || 300;
  const box = { l: left, r: width - 10, t: 10, b: height - 36 };
  const sx = scale(x, box.l, box.r), sy = scale(y, box.b, box.t);
  const out = [];
  const id = `clip-${svg.id || [...svg.parentNode.children].indexOf(svg)}`;
  out.push(`<clipPath id="${id}"><rect x="${box.l}" y="${box.t - 4}" width="${Math.max(0, box.r - box.l + 4)}" height="${box.b - box.t + 4}"/></clipPath>`);
  for (const v of ticks(x.low, x.high, x.log, Math.max(2, (box.r - box.l) / 62))) {
    const p = sx(v).toFixed(1);
    out.push(`<path class="grid" d="M${p} ${box.t}V${box.b}"/><text x="${p}" y="${box.b + 14}" text-anchor="middle">${number(v, 3)}</text>`);
  }
  if (!y.bare) for (const v of ticks(y.low, y.high, y.log, Math.max(2, (box.b - box.t) / 44))) {
    const p = sy(v).toFixed(1);
    out.push(`<path class="grid" d="M${box.l} ${p}H${box.r}"/><text x="${box.l - 5}" y="${+p + 4}" text-anchor="end">${number(v, 3)}</text>`);
  }
  out.push(`<path class="axis" d="M${box.l} ${box.t}V${box.b}H${box.r}"/>`);
  out.push(`<text x="${(box.l + box.r) / 2}" y="${height - 5}" text-anchor="middle">${text(x.label)}</text>`);
  if (y.label) out.push(`<text transform="translate(12 ${(box.t + box.b) / 2}) rotate(-90)" text-anchor="middle">${text(y.label)}</text>`);
  if (hair !== null) out.push(`<path class="hair" d="M${sx(hair).toFixed(1)} ${box.t}V${box.b}"/>`);
  out.push(`<g clip-path="url(#${id})">`);
  for (const line of lines) {
    const d = line.points.map(([a, b], i) => `${i ? "L" : "M"}${sx(a).toFixed(1)} ${sy(b).toFixed(1)}`).join("");
    out.push(`<path class="line${line.chosen ? " chosen" : ""}" stroke="${line.colour}" d="${d}"${line.dash ? ` stroke-dasharray="${line.dash}"` : ""}/>`);
  }
  for (const m of marks) {
    const cx = sx(m.x).toFixed(1), cy = sy(m.y).toFixed(1), title = `<title>${text(m.title)}</title>`;
    if (m.shape === "dot") out.push(`<circle class="dot" data-flow="${m.flow}" cx="${cx}" cy="${cy}" r="${m.chosen ? 8 : 6}" fill="${m.colour}">${title}</circle>`);
    else if (m.shape === "diamond") out.push(`<path class="special" d="M${cx} ${cy - 5.5}l5.5 5.5l-5.5 5.5l-5.5-5.5z">${title}</path>`);
    else if (m.shape === "triangle") out.push(`<path class="special" d="M${cx - 5} ${cy - 4}h10l-5 9z">${title}</path>`);
    else out.push(`<circle class="special" cx="${cx}" cy="${cy}" r="4.5">${title}</circle>`);
  }
  svg.innerHTML = `${out.join("")}</g>`;
  return { sx, sy, box };
}
