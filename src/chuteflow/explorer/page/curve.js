// The curve of all flows: the flows at the flux are points to choose, and the curve itself can be dragged.
import { draw, number } from "./chart.js";
import { flux, fluxWithin } from "./controls.js";
import { standalone } from "./standalone.js";
import { byId, colour, flowColour, sentence } from "./page.js";
import { curvePoints } from "./measured.js";
import { pinned } from "./pins.js";
import * as readout from "./readout.js";
import { change, state } from "./state.js";
import { factor, labelled, unit } from "./units.js";

const svg = byId("curve");
/** The quantity on the vertical axis; the surface temperature is that far above, or that at an interface. */
const nameOf = (quantity) => ({
  h: "centre of mass h", M: "hold-up M",
  T_surface: state.surface === "interface" ? "T_surface, at the interface" : "T_surface, far above",
})[quantity];
const shapes = { "fold-Q": "circle", "fold-M": "circle", "fold-T": "circle", "density-inversion": "diamond", "interior-change": "triangle" };
// Number of flows of each branch within the frame whose stability is examined.
const examinedPerBranch = 9;
let curve = null, flows = null, chosen = 0, shown = null, frame = null, set = null, limits = {};
// What is known about the stability of flows of the curve, by branch and place on it.
let results = new Map();
// The limits of the theory that the flows of each branch exceed, or null where not known.
let passed = null;
// While the curve is dragged: ln of the quantity at the pointer.
let held = null;
// Largest distance from the curve at which the pointer reads it, in pixels.
const near = 30;

// A small copy of the curve is shown beside the sliders where the curve itself is out of view.
const mini = byId("mini");
let away = false;
new IntersectionObserver((entries) => {
  away = entries.at(-1).intersectionRatio < 0.4;
  mini.toggleAttribute("hidden", !away);
  if (away) redraw();
}, { threshold: 0.4 }).observe(svg);

/** `setter` (parts, event) changes the state; `validity` has the words for what passes a limit, and what they mean. */
export function begin(setter, validity) {
  set = setter;
  limits = validity;
}

/** The curve, or why it is left out. */
export function takeCurve(answer) {
  curve = answer.error ? { branches: [], says: "", why: answer.error } : answer;
  byId("count").textContent = curve.says;
  results = new Map();
  passed = null;
  redraw();
}

/** The limits of the theory that the flows of the curve pass, in words. */
export function takeLimits(words) {
  passed = words;
  redraw();
}

const wordsAt = (branch, i) => passed?.[curve.branches.indexOf(branch)][i];

/** The flows at the flux and which of them is chosen; while the curve is dragged, the one at the pointer is. */
export function takeFlows(list, k) {
  flows = list;
  chosen = k;
  redraw();
}

/** Part of the curve that holds its folds and the flux, or all of it. */
function wanted() {
  const Q = flux(), name = state.against, s = factor("Q"), sn = factor(name), pins = pinned();
  const near = pins.map(({ flow, chute }) => (flow.Q * factor("Q", chute.slope)) / s), beside = pins.map(({ flow, chute }) => (flow[name] * factor(name, chute.slope)) / sn);
  for (const { x, y } of curvePoints(name)) { near.push(x / s); beside.push(y / sn); }
  const all = curve.branches.flatMap((b) => b.Q.map((q, i) => [q, b[name][i]]));
  if (!all.length) return null;
  const folds = curve.branches.flatMap((b) => b.special.filter((s) => s.kind === "fold-Q").map((s) => s.Q));
  const ends = state.whole ? all.map(([q]) => q) : [...folds.map((q) => q / 2.5), ...folds.map((q) => q * 2.5), ...(Q > 0 ? [Q / 2, Q * 2] : []), ...near.flatMap((q) => [q / 1.3, q * 1.3])];
  if (!ends.length) ends.push(...all.map(([q]) => q));
  const x = { low: Math.min(...ends), high: Math.max(...ends), log: true };
  const inside = all.filter(([q]) => q >= x.low && q <= x.high), ys = [...(inside.length ? inside : all).map((p) => p[1]), ...beside];
  return { x, y: { low: Math.min(...ys) * 0.9, high: Math.max(...ys) * 1.1, log: true }, name, whole: state.whole };
}

/** The axes stay as long as they contain the curve, so that the curve moves and not the axes. */
function settle() {
  const next = wanted();
  if (!next) { frame = null; return; }
  const span = (axis) => Math.log(axis.high / axis.low);
  const serves = (axis) => next[axis].low >= frame[axis].low && next[axis].high <= frame[axis].high && span(frame[axis]) < 1.6 * span(next[axis]);
  const same = frame && frame.name === next.name && frame.whole === next.whole;
  const dragged = same && held !== null && flux() >= frame.x.low && flux() <= frame.x.high;
  if (!(dragged || (same && serves("x") && serves("y")))) frame = next;
}

/** Stretches of a branch, as its first and last point, along which `kind` (point) stays the same. */
function* stretches(branch, kind) {
  for (let i = 0; i < branch.Q.length - 1;) {
    let j = i + 1;
    while (j < branch.Q.length - 1 && kind(j) === kind(i)) j++;
    yield [i, j];
    i = j;
  }
}

/** Lines of a branch: by the kind of density, over a band where the flows are outside the limits of the theory. */
function linesOf(branch, at) {
  const points = ([i, j]) => Array.from({ length: j - i + 1 }, (_, k) => at(i + k)), beyond = (i) => Boolean(wordsAt(branch, i)?.length);
  const bands = [...stretches(branch, beyond)].filter(([i]) => beyond(i)).map((ends) => ({ points: points(ends), colour: colour("--beyond"), width: 9, beneath: true, smooth: true }));
  const dash = ([i]) => (branch.density[i] === "monotonic" ? "7 4" : "");
  return [...bands, ...[...stretches(branch, (i) => branch.density[i])].map((ends) => ({ points: points(ends), colour: colour("--curve"), dash: dash(ends), smooth: true }))];
}

/** Where the words on a branch change: the first point of each stretch but the first. */
const changes = (branch) => [...stretches(branch, (i) => wordsAt(branch, i)?.join())].slice(1).map(([i]) => i + 1);
const words = (branch, i) => (passed ? wordsAt(branch, i).join(", ") || "within the theory" : "");

/** What the shades mean: the words of the stretches that are drawn. */
function tellLimits() {
  const seen = new Set(curve.branches.flatMap((b, k) => (passed?.[k] ?? []).filter((_, i) => inFrame(b, i)).flat()));
  byId("beyond").textContent = seen.size ? `Shaded: outside the assumptions of the theory; they change at a bar: ${[...seen].map((word) => `${word} (${limits[word]})`).join("; ")}.` : "";
}

const inFrame = (branch, i) => ["x", "y"].every((axis) => {
  const value = branch[axis === "x" ? "Q" : state.against][i];
  return value >= frame[axis].low && value <= frame[axis].high;
});

/** Flows of the curve whose stability is still to be examined: evenly along each branch in the frame, the middle first. */
export function notExamined() {
  if (!frame || !state.stability) return [];
  const wanted = curve.branches.flatMap((branch, b) => {
    const inside = branch.Q.map((_, i) => i).filter((i) => inFrame(branch, i)), count = Math.min(examinedPerBranch, inside.length);
    const chosen = Array.from({ length: count }, (_, k) => inside[Math.round(((k + 0.5) / count) * inside.length - 0.5)]);
    return chosen.map((point, k) => ({ branch: b, point, turn: (k * 4) % count }));
  });
  return wanted.filter(({ branch, point }) => !results.has(`${branch}:${point}`)).sort((a, b) => a.turn - b.turn);
}

/** Store the stability of a flow of the curve. */
export function addStability({ branch, point }, known) {
  results.set(`${branch}:${point}`, { branch, point, ...known });
  redraw();
}

/** Markers of the flows whose stability was examined; the text below counts them and names the waves. */
function stabilityMarks(at) {
  const all = state.stability ? [...results.values()].filter(({ branch, point }) => inFrame(curve.branches[branch], point)) : [];
  byId("stability-words").textContent = stabilitySentence(all);
  return all.map(({ branch, point, state: shape, says }) => ({ ...at(curve.branches[branch], point), shape, title: says }));
}

function stabilitySentence(all) {
  if (standalone) return "";
  if (!state.stability) return "Stability along the curve is not examined.";
  const count = (kind) => all.filter((one) => one.state === kind).length, left = notExamined().length;
  const counts = `× unstable (${count("unstable")}), ■ stable (${count("stable")}), ? not known (${count("unknown")})`;
  const searched = all.map((one) => one.searched).filter(Boolean), s = factor("h"), units = unit("h") || "d";
  const waves = searched.length ? ` Each was examined for waves of at least ${number(Math.max(...searched.map(([low]) => low)) * s, 2)} to ${number(Math.min(...searched.map(([, high]) => high)) * s, 2)} ${units}.` : "";
  const why = all.length && !searched.length ? ` ${sentence(all[0].reason ?? all[0].says)}` : "";
  return `Stability of ${all.length} ${all.length === 1 ? "flow" : "flows"} of the curve${left ? `, ${left} to come` : ""}: ${counts}. Between them nothing is known.${waves}${why}`;
}

export function redraw() {
  if (!curve) return;
  settle();
  if (!frame) {
    svg.innerHTML = "";
    byId("stability-words").textContent = "";
    byId("beyond").textContent = "";
    byId("curve-words").textContent = curve.why ? sentence(curve.why) : "No curve: this chute has no flows in the range searched.";
    shown = null;
    return;
  }
  byId("curve-words").textContent = "";
  const name = state.against, sq = factor("Q"), sn = factor(name), lines = [], marks = [];
  const at = (branch, i) => ({ x: branch.Q[i] * sq, y: branch[name][i] * sn });
  const axis = ({ low, high, log }, s, label) => ({ low: low * s, high: high * s, log, label });
  for (const { flow, chute, curve: other, letter, dash, colour: ink } of pinned()) {
    const [q, n] = [factor("Q", chute.slope), factor(name, chute.slope)];
    for (const branch of other?.branches ?? []) lines.push({ points: branch.Q.map((value, i) => [value * q, branch[name][i] * n]), colour: ink, dash, width: 1.5, smooth: true });
    marks.push({ x: flow.Q * q, y: flow[name] * n, shape: "pin", letter, title: `pinned: ${flow.name}` });
  }
  for (const branch of curve.branches) {
    lines.push(...linesOf(branch, (i) => [branch.Q[i] * sq, branch[name][i] * sn]));
    for (const s of branch.special) marks.push({ x: s.Q * sq, y: s[name] * sn, shape: shapes[s.kind] ?? "circle", title: curve.kinds[s.kind] ?? s.kind });
    for (const i of changes(branch)) marks.push({ ...at(branch, i), shape: "bar", title: words(branch, i) });
  }
  marks.push(...stabilityMarks(at));
  (flows ?? []).forEach((flow, i) => marks.push({ x: flow.Q * sq, y: flow[name] * sn, shape: "dot", flow: i, colour: flowColour(i), chosen: i === chosen, title: flow.name }));
  const x = axis(frame.x, sq, labelled("mass flux Q", "Q")), y = axis(frame.y, sn, labelled(nameOf(name), name));
  shown = draw(svg, { x, y, points: curvePoints(name), lines, marks, hair: flux() * sq });
  if (away) draw(mini, { x: { ...x, label: "" }, y: { ...y, label: name }, lines, marks: marks.filter(({ shape }) => shape === "dot"), hair: flux() * sq });
  tellLimits();
  if (!readAgain() && svg.matches(":focus-visible")) readout.speak(readChosen());
  svg.setAttribute("aria-valuenow", String(fluxWithin(Number(state.Q) || 0) * sq));
  svg.setAttribute("aria-valuemin", String(frame.x.low * sq));
  svg.setAttribute("aria-valuemax", String(frame.x.high * sq));
}

/** The point of the curve that is nearest to the pointer: its flux and the quantity. */
function nearest(px, py) {
  const name = state.against, sq = factor("Q"), sn = factor(name);
  let best = Infinity, found = null;
  for (const b of curve.branches) for (let i = 1; i < b.Q.length; i++) {
    const [x0, x1] = [i - 1, i].map((k) => shown.sx(b.Q[k] * sq)), [y0, y1] = [i - 1, i].map((k) => shown.sy(b[name][k] * sn));
    const along = ((px - x0) * (x1 - x0) + (py - y0) * (y1 - y0)) / ((x1 - x0) ** 2 + (y1 - y0) ** 2 || 1);
    const w = Math.max(0, Math.min(1, along)), off = Math.hypot(px - x0 - w * (x1 - x0), py - y0 - w * (y1 - y0));
    const between = (list) => list[i - 1] ** (1 - w) * list[i] ** w;
    if (off < best) { best = off; found = { Q: between(b.Q), value: between(b[name]), off, kind: `density ${b.density[w < 0.5 ? i - 1 : i]}`, limits: words(b, w < 0.5 ? i - 1 : i) }; }
  }
  return found;
}

/** Show the numbers of a flow of the curve beside it; returns them in words. */
function read({ Q, value, kind, limits: beyond }) {
  const name = state.against, said = [["Q", Q], [name, value]].map(([symbol, v]) => `${symbol} ${number(v * factor(symbol))}${unit(symbol) ? ` ${unit(symbol)}` : ""}`);
  const says = [said.join(", "), kind, beyond].filter(Boolean).map((text) => ({ text }));
  readout.place(svg, shown, { x: shown.sx(Q * factor("Q")), y: shown.sy(value * factor(name)), says });
  return says.map(({ text }) => text).join("; ");
}

/** The same of the flow at the pointer, if the curve is near. */
function readPointer(x, y) {
  const point = shown && held === null ? nearest(x, y) : null;
  if (point && point.off < near) read(point); else readout.clear(svg);
}

/** The same of the chosen flow, which the keys move along the curve. */
function readChosen() {
  const flow = flows?.[chosen];
  return flow && shown ? read({ Q: flow.Q, value: flow[state.against], kind: flow.kinds, limits: flow.validity.words.join(", ") }) : "";
}

function moveTo(event) {
  const box = svg.getBoundingClientRect(), point = shown && nearest(event.clientX - box.left, event.clientY - box.top);
  if (!point) return;
  held = Math.log(point.value);
  set({ Q: fluxWithin(point.Q) }, event);
}

/** Which flow the pointer holds: the nearest of those at the flux, or null where none is held. */
export function heldFlow(list) {
  if (held === null || !list.length) return null;
  const off = list.map((flow) => Math.abs(Math.log(flow[state.against]) - held));
  return off.indexOf(Math.min(...off));
}

svg.addEventListener("pointerdown", (event) => {
  const flow = event.target.dataset?.flow;
  held = flow === undefined ? 0 : Math.log(flows[flow][state.against]);
  svg.setPointerCapture(event.pointerId);
  if (flow === undefined) moveTo(event); else set({ flow }, event);
});
svg.addEventListener("pointermove", (event) => { if (held !== null) moveTo(event); });
for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => {
  if (held === null) return;
  const flow = heldFlow(flows ?? []);
  if (flow !== null) change({ flow });
  held = null;
});
const readAgain = readout.followPointer(svg, {
  read: readPointer,
  key: (name) => {
    if (!name) { readout.speak(readChosen()); return true; }
    const turn = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[name];
    if (turn) set({ Q: fluxWithin((Number(state.Q) || 0) * 1.01 ** turn) });
    return Boolean(turn);
  },
});
