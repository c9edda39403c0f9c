// The map: the flows of chutes over two of the four parameters, with this chute as a cross-hair to drag.
import { ask, Debounced } from "./ask.js";
import { draw, number } from "./chart.js";
import { byId, colour, sentence } from "./page.js";
import * as readout from "./readout.js";
import { chute, state } from "./state.js";

const svg = byId("map"), key = byId("map-key"), selects = { x: byId("map-x"), y: byId("map-y") };
const names = ["slope", "e", "ew", "roughness"];
// Numbers from this on are shown alike.
const many = 6;
const capped = (count) => Math.min(count, many), countName = (count) => (count === many ? `${many} or more` : count);
// Shadings: label, title, values that are distinguished, and their names.
const shadings = {
  most: { label: "flows at one flux", says: "At most this many flows share one flux", value: capped, name: countName },
  families: { label: "branches", says: "Solution branches that do not connect", value: capped, name: countName },
  density: { label: "density", says: "Densities among the flows", value: (bits) => bits, name: (bits) => ["no flow", "monotonic", "inverted", "both"][bits] },
  interior: { label: "interior", says: "Interiors among the flows", value: (bits) => bits, name: (bits) => ["dissipative", "mixed", "productive"].filter((_, i) => bits & (1 << i)).join(" + ") || "no flow" },
};
// Columns to begin with, and how narrow the stretches between columns may become, or those beside an unknown one.
const first = 8, finest = 64, finestUnknown = 16, evenly = Array.from({ length: first + 1 }, (_, i) => i / first);
// The value of what is unknown, which is hatched.
const unknown = -1;
// Largest number of values near which a column is classified on a finer grid.
const mostNear = 32;
let about = null, set = null, failure = "", shown = null, holding = false;
// The question: all but the cross-hair. Its columns in order, and whether all that are needed are there.
let wanted = {}, columns = [], whole = false, drawn = null;
// Whether the columns are coarse ones, a preview while the sliders move, and whether the map is in view.
let rough = false, seen = true;
// Parts of a stretch between two columns that are drawn straight.
const bends = 6;

/** `given` is what the server says about itself; `setter` (parts, event) changes the state. */
export function begin(given, setter) {
  about = given;
  set = setter;
  for (const [axis, select] of Object.entries(selects)) {
    for (const name of names) select.append(new Option(about.controls[name].label.toLowerCase(), name));
    select.addEventListener("change", (event) => {
      const other = axis === "x" ? "y" : "x", swap = state[other] === event.target.value ? { [other]: state[axis] } : {};
      set({ [axis]: event.target.value, ...swap }, event);
    });
  }
  for (const [name, { label }] of Object.entries(shadings)) byId("shade").append(new Option(label, name));
  byId("shade").addEventListener("change", (event) => set({ shade: event.target.value }, event));
  changed(() => true);
}

/** After a change of the state: a new map where anything but the cross-hair moved. */
export function changed(has) {
  for (const axis of ["x", "y"]) selects[axis].value = state[axis];
  byId("shade").value = state.shade;
  // A cross-hair that moves asks nothing: one map serves all of its positions.
  const moved = has("x", "y", "surface", "closure") || names.some((name) => has(name) && name !== state.x && name !== state.y);
  if (moved || has("shade")) asking.begin();
  if (moved && seen) roughly.ask();
  if (has("shade")) drawn = null;
  if (!shown || moved || has("shade", "theme")) redraw(); else placeHair();
}

/** What is asked of a map: all of the state but the cross-hair. */
function question() {
  const { x, y } = state, held = Object.entries(chute()).filter(([name]) => name !== x && name !== y);
  return { ...Object.fromEntries(held), x, y };
}

new IntersectionObserver((entries) => { seen = entries.at(-1).isIntersecting; }).observe(svg);

/** A coarse map while the sliders move, one at a time: the last that is wanted comes next. */
const roughly = {
  busy: false,
  next: null,
  ask() {
    this.next = question();
    if (!this.busy) this.work();
  },
  async work() {
    this.busy = true;
    while (this.next) {
      const query = this.next;
      this.next = null;
      const found = [], left = [...evenly];
      // Two at a time: a browser has few connections, and flows must not wait for one.
      const some = async () => {
        for (let place = left.shift(); place !== undefined; place = left.shift()) found.push({ ...await ask("map", { ...query, place, coarse: 1 }), place });
      };
      await Promise.all([some(), some()]);
      found.sort((a, b) => a.place - b.place);
      // What is wrong is said by the map that follows.
      if (found.some((column) => column.error && column.status !== 422)) continue;
      const here = question(), axes = here.x === query.x && here.y === query.y;
      if (!axes || (!rough && JSON.stringify(here) === JSON.stringify(wanted))) continue;
      rough = true;
      take(query, found.map((column) => (column.error ? withoutAnswer(query, column.place) : column)), false);
    }
    this.busy = false;
  },
};

const asking = new Debounced(150, async (signal) => {
  const query = question();
  const known = !rough && JSON.stringify(query) === JSON.stringify(wanted) ? columns : [];
  let places = known.length ? narrower(known) : evenly;
  failure = "";
  while (places.length) {
    for (const place of places) {
      const column = await ask("map", { ...query, place, near: near(known, place) }, signal);
      signal.throwIfAborted();
      if (column.error && column.status !== 422) {
        // What is wrong with the chute is said above.
        failure = column.status === 400 ? "No map of this chute." : sentence(column.error);
        [wanted, columns, drawn] = [{}, [], null];
        redraw();
        return;
      }
      known.push({ ...(column.error ? withoutAnswer(query, place) : column), place });
      known.sort((a, b) => a.place - b.place);
      if (known.length <= first) continue;
      rough = false;
      take(query, known, false);
    }
    places = narrower(known);
  }
  rough = false;
  take(query, known, true);
});

function take(query, found, all) {
  wanted = query;
  columns = found;
  whole = all;
  drawn = null;
  redraw();
}

/** A column of which nothing is known. Columns run along a parameter of the base, if there is one. */
function withoutAnswer({ x, y }, place) {
  const ofBase = (name) => name === "ew" || name === "roughness";
  const [outer, inner] = ofBase(x) && !ofBase(y) ? [y, x] : [x, y], { low, high } = about.controls[outer];
  return { outer, inner, at: low + place * (high - low), parts: null };
}

/** Values at which the neighbouring columns change: there a new one is classified on a finer grid. */
function near(found, place) {
  const left = found.findLast((column) => column.place < place), right = found.find((column) => column.place > place);
  const stops = [left, right].flatMap((column) => Object.values(column?.parts ?? {}).flatMap((part) => part.stops));
  return [...new Set(stops.map((stop) => stop.toPrecision(4)))].slice(0, mostNear).join(",");
}

/** What of a column is shaded. */
function shaded({ parts }) {
  if (!parts) return { stops: [], values: [unknown] };
  const { stops, values } = parts[state.shade], told = values.map(shadings[state.shade].value);
  const kept = stops.map((_, i) => i).filter((i) => told[i] !== told[i + 1]);
  return { stops: kept.map((i) => stops[i]), values: [told[0], ...kept.map((i) => told[i + 1])] };
}

const alike = (a, b) => String(a.values) === String(b.values);

/** How well two boundaries correspond, given how far apart they are as a fraction of the column: better the more of the values to their sides agree. */
function likeness(a, i, b, j, apart) {
  const agree = Number(a.values[i] === b.values[j]) + Number(a.values[i + 1] === b.values[j + 1]);
  return [0.2 - 4 * apart, 0.6 - 3 * apart, 1 - 0.9 * apart][agree];
}

/** The stops of two columns that correspond, as pairs of their numbers in order: those that are the most alike in all. */
function corresponding(a, b, span) {
  const [n, m] = [a.stops.length, b.stops.length], best = Array.from({ length: n + 1 }, () => Array.from({ length: m + 1 }, () => ({ score: 0, pairs: [] })));
  for (let i = n - 1; i >= 0; i--) for (let j = m - 1; j >= 0; j--) {
    const next = best[i + 1][j + 1], paired = { score: next.score + likeness(a, i, b, j, Math.abs(a.stops[i] - b.stops[j]) / span), pairs: [[i, j], ...next.pairs] };
    best[i][j] = [best[i + 1][j], best[i][j + 1], paired].reduce((one, two) => (two.score > one.score ? two : one));
  }
  return best[0][0].pairs;
}

/**
 * Slopes of each boundary at each column, so that the cubics through all columns are monotonic (Fritsch and Carlson).
 * `pairs` are the stops that correspond, of each two neighbours.
 */
function slopes(seen, pairs) {
  const secant = (i, [j, k]) => (seen[i + 1].stops[k] - seen[i].stops[j]) / (seen[i + 1].at - seen[i].at);
  return seen.map(({ stops }, i) => stops.map((_, k) => {
    const before = pairs[i - 1]?.find((pair) => pair[1] === k), after = pairs[i]?.find((pair) => pair[0] === k);
    const [left, right] = [before && secant(i - 1, before), after && secant(i, after)];
    if (left === undefined || right === undefined) return left ?? right ?? 0;
    return left * right <= 0 ? 0 : (2 * left * right) / (left + right);
  }));
}

/** A boundary from one column to the next, at a fraction `w` of the way. */
function along(w, from, to, steep0, steep1, width) {
  const v = 1 - w;
  return v * v * (1 + 2 * w) * from + w * w * (3 - 2 * w) * to + w * v * v * width * steep0 - w * w * v * width * steep1;
}

/**
 * Where the stops of two columns are half-way between them. Those that correspond, as `pairs`, are where `meet` (pair)
 * says; a band that only one column has ends there in a point, and what begins or ends at a side of the map does so at
 * that side.
 */
function middles(a, b, pairs, meet, low, high) {
  const ends = [[...a.stops], [...b.stops]];
  const differs = { first: a.values[0] !== b.values[0], last: a.values.at(-1) !== b.values.at(-1) };
  let before = [-1, -1], least = low;
  for (const pair of [...pairs, [a.stops.length, b.stops.length]]) {
    const final = pair[0] === a.stops.length, most = final ? high : meet(pair), between = [0, 1].map((k) => [before[k] + 1, pair[k]]);
    const alone = [a, b].flatMap(({ stops }, k) => stops.slice(...between[k]));
    const [opens, closes] = [before[0] < 0 && differs.first, final && differs.last];
    if (alone.length && !(opens && closes)) {
      const mean = alone.reduce((sum, stop) => sum + stop, 0) / alone.length, point = opens ? low : closes ? high : Math.min(most, Math.max(least, mean));
      for (const k of [0, 1]) ends[k].fill(point, ...between[k]);
    }
    if (!final) [0, 1].forEach((k) => { ends[k][pair[k]] = most; });
    [before, least] = [pair, most];
  }
  return ends;
}

/** Middles of the stretches between columns whose classes do not follow from one another. */
function narrower(found) {
  const seen = found.map(shaded), places = [];
  for (let i = 1; i < found.length; i++) {
    const width = found[i].place - found[i - 1].place, follows = alike(seen[i - 1], seen[i]);
    const narrowest = seen[i - 1].values.includes(unknown) || seen[i].values.includes(unknown) ? finestUnknown : finest;
    if (width > 1.5 / narrowest && (!follows || (width > 1.5 / (4 * first) && seen[i].stops.length))) places.push((found[i - 1].place + found[i].place) / 2);
  }
  return places;
}

/** No boundary passes the one below it. */
const ordered = (stops) => stops.map((_, k) => Math.max(...stops.slice(0, k + 1)));

/** For many narrow stretches between columns: where they begin and end, and stops and values there. */
function* stretches(found, part, low, high) {
  const seen = found.map((one) => ({ at: one.at, ...part(one) })), pairs = seen.slice(1).map((b, i) => corresponding(seen[i], b, high - low)), steep = slopes(seen, pairs);
  for (let i = 1; i < found.length; i++) {
    const [a, b] = [seen[i - 1], seen[i]], width = b.at - a.at, those = pairs[i - 1];
    const meet = ([j, k], w = 0.5) => along(w, a.stops[j], b.stops[k], steep[i - 1][j], steep[i][k], width);
    const [left, right] = middles(a, b, those, meet, low, high);
    // What corresponds bends, the rest goes straight to where it ends or from where it begins.
    const leftAt = (w) => ordered(a.stops.map((stop, j) => { const pair = those.find((one) => one[0] === j); return pair ? meet(pair, w) : stop + (left[j] - stop) * 2 * w; }));
    const rightAt = (w) => ordered(b.stops.map((stop, k) => { const pair = those.find((one) => one[1] === k); return pair ? meet(pair, w) : right[k] + (stop - right[k]) * (2 * w - 1); }));
    for (const [from, stopsAt, values] of [[0, leftAt, a.values], [0.5, rightAt, b.values]]) {
      const parts = those.length ? bends / 2 : 1;
      for (let n = 0; n < parts; n++) {
        const [start, end] = [n, n + 1].map((one) => from + one / (2 * parts));
        yield [a.at + start * width, a.at + end * width, stopsAt(start), stopsAt(end), values];
      }
    }
  }
}

/** Areas of one value, and lines between hot and not, in the coordinates of the map. */
function pieces(found, x) {
  const { outer, inner } = found[0], { low, high } = about.controls[inner], areas = new Map(), lines = [];
  const at = (o, i) => (outer === x ? [o, i] : [i, o]);
  let open = [];
  for (const [from, to, start, end, values] of stretches(found, shaded, low, high)) {
    const before = open;
    open = [];
    values.forEach((value, k) => {
      const [p, q] = [start, end].map((stops) => [low, ...stops, high].slice(k, k + 2));
      if (p[0] === p[1] && q[0] === q[1]) return;
      // What goes on from one stretch to the next is one area, without a seam.
      let area = before.find((one) => one.value === value && one.ends[0] === p[0] && one.ends[1] === p[1]);
      if (!area) {
        area = { value, down: [at(from, p[0])], up: [at(from, p[1])] };
        areas.set(value, [...(areas.get(value) ?? []), area]);
      }
      area.down.push(at(to, q[0]));
      area.up.push(at(to, q[1]));
      open.push(Object.assign(area, { ends: q }));
    });
  }
  for (const [value, those] of areas) areas.set(value, those.map(({ down, up }) => [...down, ...up.reverse()]));
  for (const [from, to, start, end] of stretches(found, ({ parts }) => parts?.hot ?? { stops: [], values: [unknown] }, low, high)) start.forEach((stop, k) => lines.push([at(from, stop), at(to, end[k])]));
  return { areas, lines };
}

/** Only the cross-hair moves while it is dragged; the map stays. */
function placeHair() {
  const { sx, sy, box } = shown, places = [sx(Number(state[state.x])), sy(Number(state[state.y]))];
  const inside = places.every((place) => Math.abs(place) < 1e5), [x, y] = (inside ? places : [0, 0]).map((place) => place.toFixed(1));
  for (const id of ["map-hair", "map-here"]) byId(id).style.display = inside ? "" : "none";
  byId("map-hair").setAttribute("d", `M${x} ${box.t}V${box.b}M${box.l} ${y}H${box.r}`);
  for (const [name, value] of [["cx", x], ["cy", y]]) byId("map-here").setAttribute(name, value);
  const [across, up] = [state.x, state.y].map((name) => `${about.controls[name].label} ${state[name]}`);
  svg.setAttribute("aria-label", `Map of chutes, cross-hair at ${across}, ${up}: move it with the arrow keys`);
}

/** Draw the map as far as it is known. */
export function redraw() {
  const current = columns.length && wanted.x === state.x && wanted.y === state.y;
  if (current) drawn ??= pieces(columns, state.x);
  const axis = (name) => {
    const { low, high, label, symbol } = about.controls[name];
    return { low, high, label: `${label.toLowerCase()} ${symbol}` };
  };
  const { says, name } = shadings[state.shade], values = current ? [...drawn.areas.keys()].sort((a, b) => a - b) : [];
  const told = values.filter((value) => value !== unknown), shade = (value) => colour(`--map${Math.min(told.indexOf(value), 7)}`);
  shown = draw(svg, {
    x: axis(state.x), y: axis(state.y),
    areas: values.map((value) => ({ rings: drawn.areas.get(value), colour: value === unknown ? "" : shade(value) })),
    lines: current ? drawn.lines.map((points) => ({ points, colour: colour("--curve") })) : [],
  });
  svg.classList.toggle("waiting", !current || !whole);
  svg.insertAdjacentHTML("beforeend", `<path id="map-hair" class="hair"/><circle id="map-here" class="special" r="4.5"><title>this chute</title></circle>`);
  const legend = told.map((value) => `<svg viewBox="0 0 2 2" aria-hidden="true"><rect width="2" height="2" fill="${shade(value)}"/></svg>${name(value)}`);
  key.innerHTML = current ? `${says}: ${legend.join(" ")}${told.length < values.length ? "; hatched: not known, the computation takes too long" : ""}.${drawn.lines.length ? " Line: on one side of it there are flows at every high temperature." : ""} Drag the cross-hair to another chute.` : "";
  placeHair();
  readAgain();
  key.append(failure || (current && whole ? "" : rough ? " Coarse, until the sliders rest." : ` Drawing: ${current ? columns.length : 0} columns so far.`));
  svg.classList.toggle("failed", Boolean(failure));
}

function move(event) {
  const box = svg.getBoundingClientRect();
  const inside = (value, name) => Number(Math.min(about.controls[name].high, Math.max(about.controls[name].low, value)).toPrecision(4));
  set({
    [state.x]: inside(shown.sx.inverse(event.clientX - box.left), state.x), [state.y]: inside(shown.sy.inverse(event.clientY - box.top), state.y),
  }, event);
}

svg.addEventListener("pointerdown", (event) => { holding = true; svg.setPointerCapture(event.pointerId); move(event); });
svg.addEventListener("pointermove", (event) => { if (holding) move(event); });
for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => { holding = false; });
/** Whether a place is within a ring of points. */
function within(ring, [x, y]) {
  let inside = false;
  ring.forEach(([x1, y1], i) => {
    const [x0, y0] = ring.at(i - 1);
    if (y1 > y !== y0 > y && x < x1 + ((y - y1) / (y0 - y1)) * (x0 - x1)) inside = !inside;
  });
  return inside;
}

/** Show what the map says at a place; returns it in words. */
function read(x, y) {
  const current = columns.length && wanted.x === state.x && wanted.y === state.y;
  const found = current ? [...drawn.areas].find(([, rings]) => rings.some((ring) => within(ring, [x, y])))?.[0] ?? unknown : unknown;
  const { name, label } = shadings[state.shade];
  const says = [...[[state.x, x], [state.y, y]].map(([axis, value]) => `${about.controls[axis].label.toLowerCase()} ${number(value)}`), `${label}: ${found === unknown ? "not known" : name(found)}`];
  readout.place(svg, shown, { x: shown.sx(x), y: shown.sy(y), says: says.map((text) => ({ text })) });
  return says.join(", ");
}
/** The same where the pointer is, if that is on the map. */
function readPointer(px, py) {
  const [x, y] = [shown.sx.inverse(px), shown.sy.inverse(py)];
  const inside = [[state.x, x], [state.y, y]].every(([name, value]) => value >= about.controls[name].low && value <= about.controls[name].high);
  if (inside && !holding) read(x, y); else readout.clear(svg);
}
const readHere = () => readout.speak(read(Number(state[state.x]), Number(state[state.y])));

const readAgain = readout.followPointer(svg, {
  read: readPointer,
  key: (pressed) => {
    if (!pressed) { readHere(); return true; }
    const turn = { ArrowRight: ["x", 1], ArrowLeft: ["x", -1], ArrowUp: ["y", 1], ArrowDown: ["y", -1] }[pressed];
    if (!turn) return false;
    const name = state[turn[0]], { low, high } = about.controls[name], value = (Number(state[name]) || low) + (turn[1] * (high - low)) / 200;
    set({ [name]: Number(Math.min(high, Math.max(low, value)).toPrecision(4)) });
    readHere();
    return true;
  },
});
