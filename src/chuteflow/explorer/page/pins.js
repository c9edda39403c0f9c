// Flows that are pinned stay drawn beside those at the flux, whatever the controls say; the address holds them too.
import { ask } from "./ask.js";
import { number } from "./chart.js";
import { standalone } from "./standalone.js";
import { byId, colour, escaped } from "./page.js";
import { chute, material, state } from "./state.js";
import { factor, unit } from "./units.js";

// Pins at most, what tells their lines apart, and between which marks the address has them and their parts.
const most = 5, dashes = ["9 3", "2 3", "9 3 2 3", "14 4", "5 5"], separator = "|", part = "~";
const parameters = { slope: "tan θ", e: "e", ew: "e_w", roughness: "r", surface: "surface", closure: "closure" };
const numbers = ["Q", "h", "M", "T_surface"];
let set = null, changed = null;
// Answers by pin, as they come.
const answers = new Map();

/** `setter` (parts, event) changes the state; `listen` is called when another pin can be drawn; `chosen` tells which flow is. */
export function begin(setter, listen, chosen) {
  set = setter;
  changed = listen;
  byId("pin").addEventListener("click", (event) => {
    const key = [...Object.values(chute()), state.Q, chosen()].join(part), all = keys();
    if (!all.includes(key)) set({ pin: [...all, key].slice(-most).join(separator) }, event);
  });
  byId("pinned").addEventListener("click", (event) => {
    const { key, does } = event.target.dataset;
    if (does === "remove") set({ pin: keys().filter((one) => one !== key).join(separator) }, event);
    if (does === "show") set({ ...read(key).chute, Q: read(key).Q, flow: read(key).place }, event);
    // The button is gone, or is another one: the keyboard goes on from the table.
    if (does) byId("pinned").focus();
  });
  load();
}

const keys = () => state.pin.split(separator).filter(Boolean).slice(0, most);

/** A pin of the address. */
function read(key) {
  const parts = key.split(part);
  return { key, chute: Object.fromEntries(material.map((name, i) => [name, parts[i] ?? ""])), Q: parts[material.length] ?? "", place: parts[material.length + 1] ?? "0" };
}

const same = (one, other) => material.every((name) => String(one[name]) === String(other[name]));

/** Ask for the flows that are pinned and the curves they are on, one after another. */
export async function load() {
  for (const key of keys()) {
    if (answers.has(key)) continue;
    const pin = read(key);
    answers.set(key, {});
    const flows = standalone && !same(pin.chute, chute()) ? { error: "this page is of another chute" } : await ask("flows", { ...pin.chute, Q: pin.Q });
    answers.set(key, { flow: flows.flows?.[Number(pin.place)], error: flows.error ?? "there is no such flow" });
    changed();
    if (standalone || flows.error) continue;
    const curve = await ask("curve", pin.chute);
    if (!curve.error) answers.get(key).curve = curve;
    changed();
  }
  changed();
}

/** The pinned flows that are known: {letter, dash, colour, chute, flow, curve}; the curve where it is not the one that is shown. */
export const pinned = () => keys().map((key, i) => ({ ...read(key), ...answers.get(key), letter: "abcde"[i], dash: dashes[i], colour: colour("--pin") }))
  .filter(({ flow }) => flow).map((pin) => (same(pin.chute, chute()) ? { ...pin, curve: null } : pin));

/** The table of the pinned flows: of the chute what differs. */
export function show() {
  const all = keys().map((key, i) => ({ ...read(key), ...answers.get(key), i }));
  byId("pinned").hidden = !all.length;
  byId("pin").textContent = all.length < most ? "Pin the chosen flow" : "Pin the chosen flow in the place of the oldest";
  const differing = Object.keys(parameters).filter((name) => all.some((pin) => pin.chute[name] !== String(state[name])));
  const row = ({ key, chute: of, flow, error, i }) => {
    const letter = "abcde"[i], value = (symbol) => (flow ? number(flow[symbol] * factor(symbol, of.slope)) : "–"), what = flow ? flow.name : error ? `left out: ${error}` : "computing…";
    const buttons = [["show", "show"], ["remove", "remove"]].map(([does, text]) => `<button type="button" data-does="${does}" data-key="${escaped(key)}" aria-label="${text} ${letter}">${text}</button>`);
    return `<tr><th scope="row">${letter} <svg class="dash" viewBox="0 0 34 6" aria-hidden="true"><path d="M0 3H34" stroke="${colour("--pin")}" stroke-width="2" stroke-dasharray="${dashes[i]}"/></svg></th>
      ${differing.map((name) => `<td>${escaped(of[name])}</td>`).join("")}${numbers.map((symbol) => `<td>${value(symbol)}</td>`).join("")}<td class="words">${escaped(what)}</td><td>${buttons.join(" ")}</td></tr>`;
  };
  const subscripted = (text) => text.replace(/_(\w+)/, "<sub>$1</sub>"), units = (symbol) => (unit(symbol) ? ` (${unit(symbol)})` : "");
  byId("pinned").innerHTML = all.length ? `<table><caption>Pinned flows</caption><thead><tr><th scope="col">pin</th>${differing.map((name) => `<th scope="col">${subscripted(parameters[name])}</th>`).join("")}${numbers.map((symbol) => `<th scope="col">${subscripted(symbol)}${units(symbol)}</th>`).join("")}<th scope="col" class="words">flow</th><td></td></tr></thead><tbody>${all.map(row).join("")}</tbody></table>` : "";
}
