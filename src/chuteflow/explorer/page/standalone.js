// A page that needs no server holds the flows of one chute, and interpolates between them.
import { number } from "./chart.js";
import { factor, unit } from "./units.js";

const element = document.getElementById("standalone-data");
/** The data within the page, or null where it asks a server. */
export const standalone = element && JSON.parse(element.textContent);

const counts = ["No flow carries", "One flow carries", "Two flows share", "Three flows share", "Four flows share"];
const places = ["Q", "h", "M", "T_surface"];
// Number of parts in which each interval between two stored flows is scanned, and of bisections of a root.
const parts = 8, halvings = 40;

/** Indices and weights in a list for a position: the cubic through the four nearest of its values. */
function cubic(length, position) {
  const first = Math.max(0, Math.min(length - 4, Math.floor(position) - 1)), [a, b, c, d] = [0, 1, 2, 3].map((k) => position - first - k);
  return { first, weights: [(-b * c * d) / 6, (a * c * d) / 2, (-a * b * d) / 2, (a * b * c) / 6] };
}
const between = (value, { first, weights }) => weights.reduce((sum, weight, k) => sum + weight * value(first + k), 0);
const logarithm = (list, at) => Math.exp(between((i) => Math.log(list[i]), at));

/** Positions along a branch at which it carries the flux. */
function positions(fluxes, Q) {
  const residual = (position) => between((i) => Math.log(fluxes[i] / Q), cubic(fluxes.length, position)), found = [];
  let [before, last] = [residual(0), 0];
  for (let k = 1; k <= parts * (fluxes.length - 1); k++) {
    const here = residual(k / parts);
    if (before === 0 || (before < 0 !== here < 0 && here !== 0)) {
      let [low, high] = [last, k / parts];
      for (let n = 0; n < halvings; n++) {
        const middle = (low + high) / 2;
        if (residual(middle) < 0 === before < 0) low = middle; else high = middle;
      }
      found.push(before === 0 ? last : (low + high) / 2);
    }
    [before, last] = [here, k / parts];
  }
  return before === 0 ? [...found, last] : found;
}

/** The flow at a position of a branch. */
function flowAt(b, position) {
  const curve = standalone.curve.branches[b], { heights, top, fields, budget, names, kinds } = standalone.branches[b], at = cubic(top.length, position), nearest = Math.round(position), highest = logarithm(top, at);
  const field = ({ unit: units, rows }) => heights.map((_, n) => between((i) => units[i] * rows[i][n], at));
  return {
    ...Object.fromEntries(places.map((symbol) => [symbol, logarithm(curve[symbol], at)])),
    name: names[nearest], kinds: kinds[nearest], validity: { words: standalone.limits.words[b][nearest] }, error: standalone.error,
    profile: { z: heights.map((fraction) => fraction * highest), ...Object.fromEntries(Object.entries(fields).map(([symbol, rows]) => [symbol, field(rows)])) },
    budget: Object.fromEntries(Object.entries(budget).map(([name, list]) => [name, between((i) => list[i], at)])),
  };
}

/** All flows at a flux, from hot to cold, as the server would answer. */
function flowsAt(Q) {
  const flows = standalone.curve.branches.flatMap((branch, b) => positions(branch.Q, Q).map((position) => ({ ...flowAt(b, position), Q })));
  flows.sort((one, two) => two.T_surface - one.T_surface);
  const names = flows.map(({ name }) => name), numbered = (name, i) => `${name} (${names.slice(0, i + 1).filter((one) => one === name).length} of ${names.filter((one) => one === name).length})`;
  flows.forEach((flow, i) => { if (names.filter((one) => one === flow.name).length > 1) flow.name = numbered(flow.name, i); });
  const amount = `Q = ${number(Q * factor("Q"), 5)}${unit("Q") ? ` ${unit("Q")}` : ""}`, lead = counts[flows.length] ?? `${flows.length} flows share`;
  const each = flows.length > 1 ? `: ${flows.map(({ name }) => `one ${name}`).join("; ")}` : "", why = flows.length ? "" : ` in the range searched${standalone.curve.reason ? `: ${standalone.curve.reason}` : ""}`;
  const recipes = Object.fromEntries(Object.entries(standalone.recipes).map(([name, text]) => [name, text.replaceAll("{flux}", String(Q))]));
  return { chute: standalone.chute, flows, top: Math.max(0, ...flows.map((flow) => flow.profile.z.at(-1))) || 1, says: `${lead} ${flows.length ? "the flux " : ""}${amount}${each}${why}.`, recipes };
}

/** The answer to a question of the page. */
export const answered = (question, { Q }) => (question === "flows" ? flowsAt(Number(Q)) : standalone[question] ?? { error: "this page has no server to ask" });
