// Profiles of all flows over height, and the budget of fluctuation energy of the chosen one.
import { draw, number } from "./chart.js";
import { profilePoints } from "./measured.js";
import { byId, colour, flowColour, sizeOf } from "./page.js";
import * as readout from "./readout.js";
import { factor, labelled, unit } from "./units.js";

const panels = [["nu", "volume fraction", "ν"], ["T", "granular temperature", "T"], ["u", "velocity", "u"]];
// Panels narrower than this have a symbol as label, and numbers at the first panel only.
const narrow = 210;
const dashes = ["", "7 4", "2 3"];
// Charts over height by their id: how they were drawn, the lines that can be read, and up to which height.
const charts = new Map();
// The height that is read in all charts, or null; the arrow keys move it by this fraction of the chart.
let height = null;
const step = 1 / 40;

/** What is read off a line {z, values, colour, label, factor} at a height, or null above its end. */
function valueAt({ z, values, factor: s }, at) {
  const i = z.findIndex((one) => one >= at);
  if (i < 0 || at < z[0]) return null;
  if (i === 0) return values[0] * s;
  const w = (at - z[i - 1]) / (z[i] - z[i - 1]);
  return (values[i - 1] * (1 - w) + values[i] * w) * s;
}

/** Show what all charts say at the height that is read. */
function read() {
  const sz = factor("z");
  const said = [];
  for (const [id, { shown, lines, top }] of charts) {
    const svg = byId(id);
    readout.clear(svg);
    if (height === null || height > top || !lines.length) continue;
    const found = lines.map((line) => ({ ...line, value: valueAt(line, height) })).filter(({ value }) => value !== null);
    const y = shown.sy(height * sz), place = `z ${number(height * sz, 3)}${unit("z") ? ` ${unit("z")}` : ""}`;
    const says = found.map(({ value, colour: ink, label }) => ({ text: `${label} ${number(value, 3)}`, colour: ink }));
    readout.place(svg, shown, { y, dots: found.map(({ value, colour: ink }) => ({ x: shown.sx(value), y, colour: ink })), says: [{ text: place }, ...says] });
    said.push([id, [place, ...says.map(({ text }) => text)].join(", ")]);
  }
  return Object.fromEntries(said);
}

/** A chart over height is read by the pointer and the keys. */
function readable(id) {
  const svg = byId(id), at = () => charts.get(id);
  readout.follow(svg, {
    over: (_, y) => {
      if (!at()) return;
      const z = at().shown.sy.inverse(y) / factor("z");
      height = z >= 0 && z <= at().top ? z : null;
      read();
    },
    away: () => {
      height = null;
      read();
    },
    key: (name) => {
      if (!at()) return false;
      const { top } = at(), turn = { ArrowUp: step, ArrowDown: -step, PageUp: 10 * step, PageDown: -10 * step }[name];
      if (name && !turn && name !== "Home" && name !== "End") return false;
      height = name === "Home" ? 0 : name === "End" ? top : Math.min(top, Math.max(0, (height ?? top / 4) + (turn ?? 0) * top));
      readout.speak(read()[id] ?? "");
      return true;
    },
  });
}

for (const id of ["profile-nu", "profile-T", "profile-u", "budget"]) readable(id);

/** Profiles of the flows at the flux, and of those that are pinned. */
export function drawProfiles(list, height, chosen, pins) {
  const sz = factor("z"), pinned = pins.map((pin) => ({ ...pin, ratio: (symbol) => factor(symbol, pin.chute.slope) / factor(symbol) }));
  const top = Math.max(list.length ? height : 0, ...pinned.map(({ flow, ratio }) => Math.min(2.5 * flow.h, flow.profile.z.at(-1)) * ratio("z")), ...(list.length || pinned.length ? [] : profilePoints("nu").map(({ y }) => y / sz)));
  for (const [symbol, words, letter] of panels) {
    const svg = byId(`profile-${symbol}`);
    svg.setAttribute("aria-label", `${words} against height for ${list.length} flows and ${pinned.length} pinned: the arrow keys read values`);
    charts.delete(svg.id);
    const points = profilePoints(symbol).filter(({ y }) => y <= top * sz);
    if (!list.length && !pinned.length && !points.length) { svg.innerHTML = ""; continue; }
    const s = factor(symbol), { width } = sizeOf(svg), bare = symbol !== "nu" && width < narrow;
    const label = labelled(width < narrow && unit(symbol) ? letter : `${words} ${letter}`, symbol);
    const largest = Math.max(...list.flatMap((flow) => flow.profile[symbol]), ...pinned.flatMap(({ flow, ratio }) => flow.profile[symbol].map((v) => v * ratio(symbol))), ...points.map(({ x }) => x / s)) * s;
    const shown = draw(svg, {
      x: { low: 0, high: largest * 1.05, label },
      y: { low: 0, high: top * sz, label: bare ? "" : labelled("height z", "z"), bare },
      points,
      lines: [...pinned.map(({ flow, ratio, dash, colour: ink }) => ({
        points: flow.profile.z.map((z, n) => [flow.profile[symbol][n] * ratio(symbol) * s, z * ratio("z") * sz]), colour: ink, dash,
      })), ...list.flatMap((flow, i) => {
        const points = flow.profile.z.map((z, n) => [flow.profile[symbol][n] * s, z * sz]);
        const band = flow.validity.words.length ? [{ points, colour: colour("--beyond"), width: 9, beneath: true }] : [];
        return [...band, { points, colour: flowColour(i), width: i === chosen ? 3.4 : 2 }];
      })],
    });
    const lines = list.map((flow, i) => ({ z: flow.profile.z, values: flow.profile[symbol], colour: flowColour(i), label: letter, factor: s }));
    lines.push(...pinned.map(({ flow, ratio, letter: pin, colour: ink }) => ({ z: flow.profile.z.map((z) => z * ratio("z")), values: flow.profile[symbol], colour: ink, label: `${pin}: ${letter}`, factor: s * ratio(symbol) })));
    charts.set(svg.id, { shown, top, lines });
  }
  if (height !== null) read();
}

export function drawBudget(flow, i) {
  drawRates(flow, i);
  drawBudgetBars(flow, i);
}

/** Work, conduction and dissipation at each height; their sum is zero in a steady flow. */
function drawRates(flow, i) {
  const svg = byId("budget");
  charts.delete(svg.id);
  if (!flow) { svg.innerHTML = ""; byId("budget-key").textContent = ""; return; }
  const { z, production, dissipation } = flow.profile, s = factor("gamma"), sz = factor("z");
  const terms = [production, production.map((work, n) => dissipation[n] - work), dissipation.map((loss) => -loss)];
  const largest = Math.max(...terms.flat().map(Math.abs)) * s * 1.05 || 1, top = Math.min(2.5 * flow.h, z.at(-1));
  const within = z.filter((height) => height <= top).length;
  // The points up to the top, and one there between its neighbours.
  const upToTop = (values) => {
    const fraction = within < z.length ? (top - z[within - 1]) / (z[within] - z[within - 1]) : 0;
    const last = fraction > 0 ? [[values[within - 1] + fraction * (values[within] - values[within - 1]), top]] : [];
    return [...values.slice(0, within).map((v, n) => [v, z[n]]), ...last];
  };
  const shown = draw(svg, {
    x: { low: -largest, high: largest, label: labelled("gain of fluctuation energy per volume", "gamma") },
    y: { low: 0, high: top * sz, label: labelled("height z", "z") },
    lines: terms.map((term, k) => ({ points: upToTop(term).map(([v, height]) => [v * s, height * sz]), colour: flowColour(i), dash: dashes[k] })),
    hair: 0,
  });
  const labels = ["work", "conduction", "dissipation"];
  const lines = terms.map((term, k) => ({ z, values: term, colour: flowColour(i), label: labels[k], factor: s }));
  charts.set(svg.id, { shown, top, lines });
  if (height !== null) read();
  const inner = dissipation.slice(0, within), wins = production.slice(0, within).map((work, n) => work - inner[n]);
  const heated = wins.every((v) => v <= 0) ? "conduction brings heat at every height" : wins.every((v) => v >= 0) ? "conduction takes heat at every height" : "conduction takes heat from where work exceeds dissipation to where it does not";
  byId("budget-key").textContent = `Solid: work of shear; dashed: conduction; dotted: dissipation, a loss. They add up to 0: ${heated}.`;
  svg.setAttribute("aria-label", `Work, conduction and dissipation against height: ${heated}. The arrow keys read values`);
}

/** The same for the whole flow, with what happens at the base. */
function drawBudgetBars(flow, i) {
  const svg = byId("budget-bars");
  if (!flow) { svg.innerHTML = ""; byId("budget-words").textContent = ""; return; }
  const b = flow.budget, above = Math.max(0, -b.heat_through_surface), total = b.slip_work + b.shear_work + above;
  const rows = [
    ["gained", [["slip on the base", b.slip_work, 1], ["shear inside", b.shear_work, 0.6], ["free grains above", above, 0.3]]],
    ["lost", [["hitting the base", b.base_loss, 1], ["among the grains", b.dissipation, 0.6]]],
  ];
  const width = sizeOf(svg).width - 60, percent = (v) => `${Math.round((100 * v) / total)} %`;
  svg.innerHTML = rows.map(([name, parts], r) => {
    let x = 58;
    const bars = parts.map(([, v, opacity]) => {
      const w = Math.max(0, (v / total) * width), bar = `<rect x="${x}" y="${4 + 22 * r}" width="${w}" height="15" fill="${flowColour(i)}" opacity="${opacity}"/>`;
      x += w + 1;
      return bar;
    });
    return `<text x="50" y="${16 + 22 * r}" text-anchor="end">${name}</text>${bars.join("")}`;
  }).join("");
  const said = rows.map(([name, parts]) => `${name}: ${parts.filter((part) => part[1] > 0).map(([what, v]) => `${what} ${percent(v)}`).join(", ")}`);
  const base = b.heat_from_base > 0 ? "The base heats the flow" : "The base cools the flow";
  byId("budget-words").textContent = `In the whole flow, ${said.join("; ")}. ${base}.`;
  svg.setAttribute("aria-label", byId("budget-words").textContent);
}
