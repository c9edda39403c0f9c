// The map: which chutes carry flows, over two of the four parameters, with this chute as a cross-hair to drag.
import { ask, AtRest } from "./ask.js";
import { draw } from "./chart.js";
import { byId, colour } from "./page.js";
import { chute, state } from "./state.js";

const svg = byId("map"), key = byId("map-key"), selects = { x: byId("map-x"), y: byId("map-y") };
const names = ["slope", "e", "ew", "roughness"];
// From this on, numbers are not told apart.
const many = 6;
const capped = (count) => Math.min(count, many), countName = (count) => (count === many ? `${many} or more` : count);
// What a chute is shaded by: its words, which of its values are told apart, and how they are called.
const shadings = {
  most: { label: "flows at one flux", says: "At most this many flows share one flux", value: capped, name: countName },
  families: { label: "families", says: "Families of flows that do not connect", value: capped, name: countName },
  density: { label: "density", says: "Densities among the flows", value: (bits) => bits, name: (bits) => ["no flow", "monotonic", "inverted", "both"][bits] },
  interior: { label: "interior", says: "Interiors among the flows", value: (bits) => bits, name: (bits) => ["dissipative", "mixed", "productive"].filter((_, i) => bits & (1 << i)).join(" + ") || "no flow" },
};
// Columns to begin with, and how narrow the stretches between columns may become.
const first = 8, finest = 64;
let about = null, set = null, failure = "", shown = null, holding = false;
// What is asked for: all but the cross-hair. Its columns in order, and whether they are all that are needed.
let wanted = {}, columns = [], whole = false, drawn = null;

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
  if (has("shade")) drawn = null;
  if (!shown || moved || has("shade", "theme")) redraw(); else placeHair();
}

const asking = new AtRest(150, async (signal) => {
  const { x, y } = state, held = Object.entries(chute()).filter(([name]) => name !== x && name !== y);
  const query = { ...Object.fromEntries(held), x, y };
  const known = JSON.stringify(query) === JSON.stringify(wanted) ? columns : [];
  let places = known.length ? narrower(known) : Array.from({ length: first + 1 }, (_, i) => i / first);
  while (places.length) {
    for (const place of places) {
      const column = await ask("map", { ...query, place }, signal);
      signal.throwIfAborted();
      failure = column.error ?? "";
      if (failure) { redraw(); return; }
      known.push({ ...column, place });
      known.sort((a, b) => a.place - b.place);
      if (known.length > first) take(query, known, false);
    }
    places = narrower(known);
  }
  take(query, known, true);
});

function take(query, found, all) {
  wanted = query;
  columns = found;
  whole = all;
  drawn = null;
  redraw();
}

/** What of a column is shaded. */
function shaded({ parts }) {
  const { stops, values } = parts[state.shade], told = values.map(shadings[state.shade].value);
  const kept = stops.map((_, i) => i).filter((i) => told[i] !== told[i + 1]);
  return { stops: kept.map((i) => stops[i]), values: [told[0], ...kept.map((i) => told[i + 1])] };
}

const alike = (a, b) => String(a.values) === String(b.values);

/** Where the stops of two columns are half-way between them: those that correspond, from either end, meet there. */
function middles(a, b) {
  const [n, m] = [a.stops.length, b.stops.length], ends = [[...a.stops], [...b.stops]];
  const meet = (i, j) => { ends[0][i] = ends[1][j] = (a.stops[i] + b.stops[j]) / 2; };
  const same = (i, j) => a.values[i] === b.values[j] && a.values[i + 1] === b.values[j + 1];
  let low = 0, high = 0;
  while (low < Math.min(n, m) && same(low, low)) { meet(low, low); low++; }
  while (high < Math.min(n, m) - low && same(n - high - 1, m - high - 1)) { high++; meet(n - high, m - high); }
  // The others stay where they are, as far as those that meet let them.
  for (const stops of ends) for (let k = low; k < stops.length - high; k++) {
    if (low) stops[k] = Math.max(stops[k], stops[low - 1]);
    if (high) stops[k] = Math.min(stops[k], stops[stops.length - high]);
  }
  return ends;
}

/** Middles of the stretches between columns whose classes do not follow from one another. */
function narrower(found) {
  const seen = found.map(shaded), places = [];
  for (let i = 1; i < found.length; i++) {
    const width = found[i].place - found[i - 1].place, follows = alike(seen[i - 1], seen[i]);
    if (width > 1.5 / finest && (!follows || (width > 1.5 / (4 * first) && seen[i].stops.length))) places.push((found[i - 1].place + found[i].place) / 2);
  }
  return places;
}

/** For each two halves of a stretch between columns: where they begin and end, and stops and values there. */
function* halves(found, part) {
  for (let i = 1; i < found.length; i++) {
    const [a, b] = [part(found[i - 1]), part(found[i])], [from, to] = [found[i - 1].at, found[i].at], middle = (from + to) / 2;
    const [left, right] = middles(a, b);
    yield [from, middle, a.stops, left, a.values];
    yield [middle, to, right, b.stops, b.values];
  }
}

/** Areas of one value, and lines between hot and not, in the coordinates of the map. */
function pieces(found, x) {
  const { outer, inner } = found[0], { low, high } = about.controls[inner], areas = new Map(), lines = [];
  const at = (o, i) => (outer === x ? [o, i] : [i, o]);
  for (const [from, to, start, end, values] of halves(found, shaded)) values.forEach((value, k) => {
    if (!areas.has(value)) areas.set(value, []);
    const [p, q] = [start, end].map((stops) => [low, ...stops, high].slice(k, k + 2));
    areas.get(value).push([at(from, p[0]), at(to, q[0]), at(to, q[1]), at(from, p[1])]);
  });
  for (const [from, to, start, end] of halves(found, (column) => column.parts.hot)) start.forEach((stop, k) => lines.push([at(from, stop), at(to, end[k])]));
  return { areas, lines };
}

/** Only the cross-hair moves while it is dragged; the map stays. */
function placeHair() {
  const { sx, sy, box } = shown, x = sx(Number(state[state.x])).toFixed(1), y = sy(Number(state[state.y])).toFixed(1);
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
    return { low, high, label: `${label.toLowerCase()} ${symbol.replace("_w", "w")}` };
  };
  const { says, name } = shadings[state.shade], values = current ? [...drawn.areas.keys()].sort((a, b) => a - b) : [];
  const shade = (value) => colour(`--map${Math.min(values.indexOf(value), 7)}`);
  shown = draw(svg, {
    x: axis(state.x), y: axis(state.y),
    areas: values.map((value) => ({ rings: drawn.areas.get(value), colour: shade(value) })),
    lines: current ? drawn.lines.map((points) => ({ points, colour: colour("--curve") })) : [],
  });
  svg.classList.toggle("waiting", !current || !whole);
  svg.insertAdjacentHTML("beforeend", `<path id="map-hair" class="hair"/><circle id="map-here" class="special" r="4.5"><title>this chute</title></circle>`);
  const legend = values.map((value) => `<svg viewBox="0 0 2 2" aria-hidden="true"><rect width="2" height="2" fill="${shade(value)}"/></svg>${name(value)}`);
  key.innerHTML = current ? `${says}: ${legend.join(" ")}. Line: on one side of it there are flows at every high temperature. Drag the cross-hair to another chute.` : "";
  placeHair();
  key.append(failure || (current && whole ? "" : ` Drawing: ${current ? columns.length : 0} columns so far.`));
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
svg.addEventListener("keydown", (event) => {
  const turn = { ArrowRight: ["x", 1], ArrowLeft: ["x", -1], ArrowUp: ["y", 1], ArrowDown: ["y", -1] }[event.key];
  if (!turn) return;
  event.preventDefault();
  const name = state[turn[0]], { low, high } = about.controls[name], value = Number(state[name]) + (turn[1] * (high - low)) / 200;
  set({ [name]: Number(Math.min(high, Math.max(low, value)).toPrecision(4)) }, event);
});
