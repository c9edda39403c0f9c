// Profiles of all flows over height, and the budget of fluctuation energy of the chosen one.
import { draw } from "./chart.js";
import { byId, colour, flowColour, sizeOf } from "./page.js";
import { factor, labelled, unit } from "./units.js";

const panels = [["nu", "volume fraction", "ν"], ["T", "granular temperature", "T"], ["u", "velocity", "u"]];
// Narrower panels than this have no room for words, nor for numbers beside all but the first.
const narrow = 210;
const dashes = ["", "7 4", "2 3"];

export function drawProfiles(list, top, chosen) {
  const sz = factor("z");
  for (const [symbol, words, letter] of panels) {
    const svg = byId(`profile-${symbol}`);
    svg.setAttribute("aria-label", `${words} against height for ${list.length} flows`);
    if (!list.length) { svg.innerHTML = ""; continue; }
    const s = factor(symbol), { width } = sizeOf(svg), bare = symbol !== "nu" && width < narrow;
    const label = labelled(width < narrow && unit(symbol) ? letter : `${words} ${letter}`, symbol);
    const largest = Math.max(...list.flatMap((flow) => flow.profile[symbol])) * s;
    draw(svg, {
      x: { low: 0, high: largest * 1.05, label },
      y: { low: 0, high: top * sz, label: bare ? "" : labelled("height z", "z"), bare },
      lines: list.flatMap((flow, i) => {
        const points = flow.profile.z.map((z, n) => [flow.profile[symbol][n] * s, z * sz]);
        const band = flow.validity.words.length ? [{ points, colour: colour("--beyond"), width: 9, beneath: true }] : [];
        return [...band, { points, colour: flowColour(i), width: i === chosen ? 3.4 : 2 }];
      }),
    });
  }
}

export function drawBudget(flow, i) {
  drawRates(flow, i);
  drawShares(flow, i);
}

/** Work, conduction and dissipation at each height; they add up to nothing in a steady flow. */
function drawRates(flow, i) {
  const svg = byId("budget");
  if (!flow) { svg.innerHTML = ""; byId("budget-key").textContent = ""; return; }
  const { z, production, dissipation } = flow.profile, s = factor("gamma"), sz = factor("z");
  const terms = [production, production.map((work, n) => dissipation[n] - work), dissipation.map((loss) => -loss)];
  const largest = Math.max(...terms.flat().map(Math.abs)) * s * 1.05 || 1, top = 2.5 * flow.h;
  const within = z.filter((height) => height <= top * 1.000001).length;
  draw(svg, {
    x: { low: -largest, high: largest, label: labelled("gain of fluctuation energy per volume", "gamma") },
    y: { low: 0, high: z[within - 1] * sz, label: labelled("height z", "z") },
    lines: terms.map((term, k) => ({ points: term.slice(0, within).map((v, n) => [v * s, z[n] * sz]), colour: flowColour(i), dash: dashes[k] })),
    hair: 0,
  });
  const inner = dissipation.slice(0, within), wins = production.slice(0, within).map((work, n) => work - inner[n]);
  const heated = wins.every((v) => v <= 0) ? "conduction brings heat at every height" : wins.every((v) => v >= 0) ? "conduction takes heat at every height" : "conduction takes heat from where work exceeds dissipation to where it does not";
  byId("budget-key").textContent = `Solid: work of shear; dashed: conduction; dotted: dissipation, a loss. They add up to 0: ${heated}.`;
  svg.setAttribute("aria-label", `Work, conduction and dissipation against height: ${heated}`);
}

/** The same for the whole flow, with what happens at the base. */
function drawShares(flow, i) {
  const svg = byId("shares");
  if (!flow) { svg.innerHTML = ""; byId("budget-words").textContent = ""; return; }
  const b = flow.budget, above = Math.max(0, -b.heat_through_surface), total = b.slip_work + b.shear_work + above;
  const rows = [
    ["gained", [["slip on the base", b.slip_work, 1], ["shear inside", b.shear_work, 0.6], ["free grains above", above, 0.3]]],
    ["lost", [["hitting the base", b.base_loss, 1], ["among the grains", b.dissipation, 0.6]]],
  ];
  const width = sizeOf(svg).width - 60, share = (v) => `${Math.round((100 * v) / total)} %`;
  svg.innerHTML = rows.map(([name, parts], r) => {
    let x = 58;
    const bars = parts.map(([, v, opacity]) => {
      const w = Math.max(0, (v / total) * width), bar = `<rect x="${x}" y="${4 + 22 * r}" width="${w}" height="15" fill="${flowColour(i)}" opacity="${opacity}"/>`;
      x += w + 1;
      return bar;
    });
    return `<text x="50" y="${16 + 22 * r}" text-anchor="end">${name}</text>${bars.join("")}`;
  }).join("");
  const said = rows.map(([name, parts]) => `${name}: ${parts.filter((part) => part[1] > 0).map(([what, v]) => `${what} ${share(v)}`).join(", ")}`);
  const base = b.heat_from_base > 0 ? "The base heats the flow" : "The base cools the flow";
  byId("budget-words").textContent = `In the whole flow, ${said.join("; ")}. ${base}.`;
  svg.setAttribute("aria-label", byId("budget-words").textContent);
}
