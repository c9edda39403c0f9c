// The page: controls, words, and the panels, each redrawn when an answer or a change of the state comes.
import { Latest } from "./ask.js";
import { draw, number } from "./chart.js";
import { show as showGrains } from "./grains.js";
import * as map from "./map.js";
import { address, change, chute, onChange, start, state, write } from "./state.js";
import { factor, labelled, setQuantities, unit } from "./units.js";

const byId = (id) => document.getElementById(id);
const colours = () => { const style = getComputedStyle(document.documentElement); return [0, 1, 2, 3, 4].map((i) => style.getPropertyValue(`--flow${i}`).trim()); };
const fields = [["nu", "volume fraction ν"], ["T", "granular temperature T"], ["u", "velocity u"]];
const heights = { h: "centre of mass h", M: "hold-up M", T_surface: "surface temperature" };
const shapes = { "fold-Q": "circle", "fold-M": "circle", "fold-T": "circle", "density-inversion": "diamond", "interior-change": "triangle" };

const about = await (await fetch("about")).json();
setQuantities(about.quantities);
start(about.presets[0].state);
byId("version").textContent = about.version;

let flows = null, curve = null, stability = null, view = null, window_ = null, dragging = false;
const chosen = () => Math.max(0, Math.min(Number(state.flow) || 0, (flows?.flows.length ?? 1) - 1));

// --- controls ---------------------------------------------------------------------------------------------------

const steps = 1000;
const position = (c, v) => (c.logarithmic ? Math.log(v / c.low) / Math.log(c.high / c.low) : (v - c.low) / (c.high - c.low)) * steps;
const value = (c, p) => (c.logarithmic ? c.low * (c.high / c.low) ** (p / steps) : c.low + ((c.high - c.low) * p) / steps);
const inputs = {};

function makeControls() {
  const form = byId("controls");
  for (const [name, c] of Object.entries(about.controls)) {
    const box = document.createElement("div");
    box.className = "control";
    box.innerHTML = `<div class="line"><label for="${name}">${c.label} <i>${c.symbol.replace(/_(.)/, "<sub>$1</sub>")}</i></label>
      <input type="number" id="${name}" step="any" required><span class="unit"></span></div>
      <input type="range" id="${name}-slider" min="0" max="${steps}" step="1" aria-label="${c.label}"><p>${c.meaning}</p>`;
    form.append(box);
    inputs[name] = { c, box, field: byId(name), slider: byId(`${name}-slider`), unit: box.querySelector(".unit") };
    inputs[name].slider.addEventListener("input", (event) => set({ [name]: Number(value(c, Number(event.target.value)).toPrecision(4)) }, event));
    inputs[name].field.addEventListener("change", (event) => {
      const typed = Number(event.target.value) / (name === "Q" ? factor("Q") : 1);
      if (event.target.value !== "" && Number.isFinite(typed)) set({ [name]: typed }, event); else showControls();
    });
    if (name === "slope") {
      box.querySelector("p").insertAdjacentHTML("beforebegin", `<div class="line"><label for="angle">Angle <i>θ</i></label><input type="number" id="angle" step="any"><span class="unit">°</span></div>`);
      byId("angle").addEventListener("change", (event) => set({ slope: Math.tan((Number(event.target.value) * Math.PI) / 180) }, event));
    }
  }
  const choices = [["surface", "Surface", about.surfaces, "Free above for ever, or an interface with free grains."],
    ["closure", "Closure", about.closures, "The law of the grains: lun, or with Fourier's heat flux."]];
  for (const [name, label, list, meaning] of choices) {
    const box = document.createElement("div");
    box.className = "control";
    box.innerHTML = `<div class="line"><label for="${name}">${label}</label><select id="${name}">${list.map((o) => `<option>${o}</option>`).join("")}</select></div><p>${meaning}</p>`;
    form.append(box);
    byId(name).addEventListener("change", (event) => set({ [name]: event.target.value }, event));
  }
  form.addEventListener("submit", (event) => event.preventDefault());
}

function showControls() {
  for (const [name, { c, field, slider, unit: shown }] of Object.entries(inputs)) {
    const v = Number(state[name]), scaled = name === "Q" ? v * factor("Q") : v;
    if (document.activeElement !== field || Number(field.value) !== scaled) field.value = String(Number(scaled.toPrecision(6)));
    slider.value = String(position(c, v));
    slider.setAttribute("aria-valuetext", `${number(scaled)} ${name === "Q" ? unit("Q") : ""}`.trim());
    shown.textContent = name === "Q" ? unit("Q") || "–" : "–";
  }
  byId("angle").value = String(Number(((Math.atan(Number(state.slope)) * 180) / Math.PI).toPrecision(6)));
  for (const name of ["surface", "closure", "d", "rho", "theme", "against"]) byId(name).value = state[name];
  for (const name of ["si", "whole"]) byId(name).checked = Boolean(state[name]);
  byId("grains").hidden = !state.si;
}

/** Change the state because of `event`, whose time the redraw is measured from. */
function set(parts, event) {
  mark = event?.timeStamp ?? performance.now();
  change(parts);
}
let mark = 0;

// --- answers ----------------------------------------------------------------------------------------------------

const asks = {
  flows: new Latest("flows", (answer, _, since) => { take(answer, () => { flows = answer; stability = null; drawFlows(); measured("flows", since); askStability(); }); }),
  curve: new Latest("curve", (answer, _, since) => { take(answer, () => { curve = answer; window_ = null; drawCurve(); measured("curve", since); }); }),
  stability: new Latest("stability", (answer, query) => {
    if (query.Q !== state.Q || Object.entries(chute()).some(([name, v]) => query[name] !== v)) return;
    stability = answer; showStability();
  }),
};

function take(answer, use) {
  byId("failure").hidden = !answer.error;
  byId("failure").textContent = answer.error ?? "";
  if (!answer.error) use();
}

/** Time from the event to the next frame, for whoever reads the performance timeline. */
function measured(name, since) {
  requestAnimationFrame(() => performance.measure(`${name}-redraw`, { start: since, end: performance.now() }));
}

let stabilityDue = null;
function askStability() {
  clearTimeout(stabilityDue);
  // Only when the sliders rest: it takes longer than they move.
  if (flows.flows.length) stabilityDue = setTimeout(() => asks.stability.ask({ ...chute(), Q: state.Q }), 600);
}

function showStability() {
  byId("flows").querySelectorAll(".stability").forEach((place, i) => {
    const found = stability?.flows?.[i];
    place.textContent = found ? found.says : "";
  });
}

onChange((changed) => {
  const has = (...names) => names.some((name) => changed.has(name));
  if (has("theme")) document.documentElement.dataset.theme = state.theme;
  showControls();
  const material = has("slope", "e", "ew", "roughness", "surface", "closure");
  if (material || has("Q")) asks.flows.ask({ ...chute(), Q: state.Q }, mark);
  if (material) asks.curve.ask(chute(), mark);
  else if (has("Q", "against", "whole", "si", "d", "rho", "theme")) { if (has("whole", "against")) window_ = null; drawCurve(); }
  if (has("flow", "si", "d", "rho", "theme")) drawFlows();
  map.changed(changed);
});

// --- words and profiles -----------------------------------------------------------------------------------------

function drawFlows() {
  if (!flows) return;
  const list = flows.flows, palette = colours(), k = chosen(), colour = (i) => palette[i % palette.length];
  byId("says").textContent = flows.says;
  const show = (symbol, v) => `${symbol.replace("_surface", "")} ${number(v * factor(symbol))}${unit(symbol) ? ` ${unit(symbol)}` : ""}`;
  byId("flows").innerHTML = list.map((flow, i) => `<label><input type="radio" name="flow" value="${i}"${i === k ? " checked" : ""}>
    <svg class="swatch" viewBox="0 0 2 2" aria-hidden="true"><circle cx="1" cy="1" r="1" fill="${colour(i)}"/></svg><span><b>${flow.name}</b>
    <span class="numbers">${["h", "M", "T_surface"].map((s) => show(s, flow[s])).join(" · ")} · error ${flow.error.toExponential(0)}</span>
    <span class="stability"></span><br><span class="quiet">${flow.words.slice(flow.name.length + 2)}</span></span></label>`).join("");
  showStability();
  byId("profiles").querySelectorAll("svg").forEach((svg, j) => {
    const [symbol, label] = fields[j], s = factor(symbol), sz = factor("z");
    const largest = Math.max(1e-12, ...list.flatMap((flow) => flow.profile[symbol])) * s;
    draw(svg, {
      left: j ? 16 : 48,
      x: { low: 0, high: largest * 1.05, label: labelled(label, symbol) },
      y: { low: 0, high: flows.top * sz, label: j ? "" : labelled("height z", "z"), bare: j > 0 && svg.clientWidth < 260 },
      lines: list.map((flow, i) => ({ points: flow.profile.z.map((z, n) => [flow.profile[symbol][n] * s, z * sz]), colour: colour(i), chosen: i === k })),
    });
  });
  showGrains(list[k] ?? null, Number(state.slope), colour(k));
  drawBudget(list[k], colour(k));
  byId("command").textContent = flows.recipes.command;
  byId("python").textContent = flows.recipes.python;
  const query = new URLSearchParams({ ...chute(), Q: state.Q });
  byId("exports").innerHTML = [["profiles", "Profiles"], ["curve", "Curve"]].map(([what, title]) =>
    `${title}: ${["csv", "svg", "png"].map((kind) => `<a download href="ask/export?${query}&what=${what}&format=${kind}">${kind.toUpperCase()}</a>`).join("")}`).join(" ");
  drawCurve();
}

byId("flows").addEventListener("change", (event) => set({ flow: event.target.value }, event));

function drawBudget(flow, colour) {
  const svg = byId("budget");
  if (!flow) { svg.innerHTML = ""; byId("budget-words").textContent = ""; return; }
  const b = flow.budget, brought = Math.max(0, -b.heat_through_surface);
  const rows = [["gained", [["slip on the base", b.slip_work, 1], ["shear inside", b.shear_work, 0.6], ["free grains above", brought, 0.3]]],
    ["lost", [["hitting the base", b.base_loss, 1], ["among the grains", b.dissipation, 0.6]]]];
  const total = b.slip_work + b.shear_work + brought, width = svg.clientWidth - 60;
  svg.innerHTML = rows.map(([name, parts], r) => {
    let x = 58;
    return `<text x="50" y="${24 + 40 * r}" text-anchor="end">${name}</text>${parts.map(([label, v, opacity]) => {
      const w = Math.max(0, (v / total) * width), share = `${label} ${Math.round((100 * v) / total)} %`;
      const out = w < 1 ? "" : `<rect x="${x}" y="${6 + 40 * r}" width="${w - 1}" height="15" fill="${colour}" opacity="${opacity}"><title>${share}</title></rect>${w > 6.2 * share.length ? `<text x="${x + 1}" y="${34 + 40 * r}">${share}</text>` : ""}`;
      x += w;
      return out;
    }).join("")}`;
  }).join("");
  const heat = b.heat_from_base > 0 ? "The base heats the flow" : "The base cools the flow";
  const words = `${heat}: collisions with it take ${Math.round((100 * b.base_loss) / b.slip_work)} % of the work of slip.`;
  byId("budget-words").textContent = words;
  svg.setAttribute("aria-label", words);
}

// --- the curve --------------------------------------------------------------------------------------------------

function curveWindow(name) {
  // Around the folds and the flux, or all. It stays while the curve is dragged, unless the flux leaves it.
  const Q = Number(state.Q), all = curve.branches.flatMap((b) => b.Q.map((q, i) => [q, b[name][i]]));
  if (!all.length) return null;
  let qs = curve.branches.flatMap((b) => b.special.filter((s) => s.kind === "fold-Q").map((s) => s.Q));
  qs = [...(qs.length ? [Math.min(...qs) / 2.5, Math.max(...qs) * 2.5] : []), Q / 2, Q * 2];
  let low = Math.min(...qs), high = Math.max(...qs);
  if (state.whole) [low, high] = [Math.min(...all.map((p) => p[0])), Math.max(...all.map((p) => p[0]))];
  const seen = all.filter(([q]) => q >= low && q <= high).map((p) => p[1]);
  const ys = seen.length ? seen : all.map((p) => p[1]);
  return { x: { low, high, log: true }, y: { low: Math.min(...ys) * 0.9, high: Math.max(...ys) * 1.1, log: true } };
}

function drawCurve() {
  const svg = byId("curve");
  if (!curve) return;
  const name = state.against, Q = Number(state.Q);
  if (!window_ || (!dragging && !state.whole) || Q < window_.x.low || Q > window_.x.high) window_ = curveWindow(name);
  byId("count").textContent = curve.says;
  svg.setAttribute("aria-valuenow", state.Q);
  if (!window_) { svg.innerHTML = ""; view = null; return; }
  const scaled = (axis, symbol, label) => ({ ...axis, low: axis.low * factor(symbol), high: axis.high * factor(symbol), label: labelled(label, symbol) });
  const ink = getComputedStyle(document.documentElement).getPropertyValue("--curve"), palette = colours();
  const sq = factor("Q"), sn = factor(name), lines = [], marks = [];
  for (const branch of curve.branches) {
    const at = (i) => [branch.Q[i] * sq, branch[name][i] * sn];
    for (let i = 0; i < branch.Q.length; ) {
      let j = i;
      while (j < branch.Q.length - 1 && branch.density[j] === branch.density[i]) j++;
      const points = [];
      for (let k = i; k <= j; k++) points.push(at(k));
      lines.push({ points, colour: ink, dash: branch.density[i] === "monotonic" ? "7 4" : "" });
      i = j > i ? j : i + 1;
    }
    for (const s of branch.special) marks.push({ x: s.Q * sq, y: s[name] * sn, shape: shapes[s.kind] ?? "circle", title: curve.kinds[s.kind] ?? s.kind });
  }
  (flows?.flows ?? []).forEach((flow, i) => marks.push({ x: flow.Q * sq, y: flow[name] * sn, shape: "dot", flow: i, colour: palette[i % palette.length], chosen: i === chosen(), title: flow.name }));
  view = draw(svg, { x: scaled(window_.x, "Q", "mass flux Q"), y: scaled(window_.y, name, heights[name]), lines, marks, hair: Q * sq });
}

/** The flux of the curve's point nearest to the pointer, or of the pointer where no curve is near. */
function nearestFlux(event) {
  const box = byId("curve").getBoundingClientRect(), px = event.clientX - box.left, py = event.clientY - box.top;
  const sq = factor("Q"), sn = factor(state.against);
  let best = Infinity, found = null;
  for (const b of curve.branches) for (let i = 1; i < b.Q.length; i++) {
    const [x0, y0, x1, y1] = [view.sx(b.Q[i - 1] * sq), view.sy(b[state.against][i - 1] * sn), view.sx(b.Q[i] * sq), view.sy(b[state.against][i] * sn)];
    const w = Math.max(0, Math.min(1, ((px - x0) * (x1 - x0) + (py - y0) * (y1 - y0)) / ((x1 - x0) ** 2 + (y1 - y0) ** 2 || 1)));
    const off = Math.hypot(px - x0 - w * (x1 - x0), py - y0 - w * (y1 - y0));
    if (off < best) { best = off; found = { Q: b.Q[i - 1] ** (1 - w) * b.Q[i] ** w, y: b[state.against][i - 1] ** (1 - w) * b[state.against][i] ** w }; }
  }
  return found;
}

function moveTo(event) {
  if (!view || !curve.branches.length) return;
  const point = nearestFlux(event);
  if (!point) return;
  const c = about.controls.Q, Q = Math.min(c.high, Math.max(c.low, Number(point.Q.toPrecision(5))));
  pick = Math.log(point.y);
  set({ Q }, event);
  choosePicked();
}
let pick = null;

/** Of the flows at the flux, choose the one that the pointer holds. */
function choosePicked() {
  if (pick === null || !flows?.flows.length) return;
  const off = flows.flows.map((flow) => Math.abs(Math.log(flow[state.against]) - pick));
  change({ flow: off.indexOf(Math.min(...off)) });
}

const curveSvg = byId("curve");
curveSvg.addEventListener("pointerdown", (event) => {
  const flow = event.target.dataset?.flow;
  if (flow !== undefined) set({ flow }, event);
  dragging = true; curveSvg.setPointerCapture(event.pointerId);
  if (flow === undefined) moveTo(event);
});
curveSvg.addEventListener("pointermove", (event) => { if (dragging) moveTo(event); });
for (const end of ["pointerup", "pointercancel"]) curveSvg.addEventListener(end, () => { if (dragging) { dragging = false; choosePicked(); pick = null; } });
curveSvg.addEventListener("keydown", (event) => {
  const turn = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
  if (!turn) return;
  event.preventDefault();
  const c = about.controls.Q;
  set({ Q: Math.min(c.high, Math.max(c.low, Number((Number(state.Q) * 1.01 ** turn).toPrecision(5)))) }, event);
});

// --- the rest ---------------------------------------------------------------------------------------------------

about.presets.forEach((preset, i) => byId("presets").append(new Option(preset.title, i)));
byId("presets").addEventListener("change", (event) => { if (event.target.value) set({ ...about.presets[event.target.value].state, flow: 0 }, event); event.target.value = ""; });
for (const name of ["d", "rho"]) byId(name).addEventListener("change", (event) => { if (Number(event.target.value) > 0) set({ [name]: event.target.value }, event); else showControls(); });
for (const name of ["theme", "against"]) byId(name).addEventListener("change", (event) => set({ [name]: event.target.value }, event));
for (const name of ["si", "whole"]) byId(name).addEventListener("change", (event) => set({ [name]: event.target.checked ? "1" : "" }, event));

for (const [button, source] of [["copy-command", "command"], ["copy-python", "python"], ["copy-address", null]]) byId(button).addEventListener("click", async () => {
  write();
  try {
    await navigator.clipboard.writeText(source ? byId(source).textContent : new URL(address(), location.href).href);
    byId("copied").textContent = "copied";
  } catch { byId("copied").textContent = "the browser does not let this page copy: select the text"; }
  setTimeout(() => { byId("copied").textContent = ""; }, 2500);
});

makeControls();
document.documentElement.dataset.theme = state.theme;
showControls();
map.begin(about, set);
new ResizeObserver(() => { drawFlows(); map.redraw(); }).observe(document.body);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { drawFlows(); map.redraw(); });
addEventListener("popstate", () => location.reload());
asks.flows.ask({ ...chute(), Q: state.Q }, performance.now());
asks.curve.ask(chute(), performance.now());
