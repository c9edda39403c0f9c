// Measurements and particle simulations, drawn behind the flows.
import { byId, colour, escaped } from "./page.js";
import { state } from "./state.js";
import { factor } from "./units.js";

const shapes = ["circle", "diamond", "triangle"], symbols = ["○", "◇", "▽"];
const parameters = ["slope", "e", "ew", "roughness"];
let all = [], set = null;

/** `data` are the flows that were measured; `setter` (parts, event) changes the state, `listen` is called when others are shown. */
export function begin(data, setter, listen) {
  all = data.map((one, i) => ({ ...one, shown: true, shape: shapes[i % shapes.length] }));
  set = setter;
  byId("data").hidden = !all.length;
  byId("data").insertAdjacentHTML("beforeend", all.map((one, i) => `<li><label><input type="checkbox" data-measured="${i}" checked> ${symbols[i % shapes.length]} <b>${escaped(one.name)}</b></label>
    <span class="quiet">${escaped(one.what)}${escaped(chuteOf(one))}</span> ${parameters.some((name) => name in one.given) ? `<button type="button" data-chute="${i}" aria-label="show the chute of ${escaped(one.name)}">its chute</button>` : ""}</li>`).join(""));
  byId("data").addEventListener("change", (event) => {
    all[event.target.dataset.measured].shown = event.target.checked;
    listen();
  });
  byId("data").addEventListener("click", (event) => {
    const one = all[event.target.dataset.chute];
    if (!one) return;
    const known = Object.fromEntries(parameters.filter((name) => name in one.given).map((name) => [name, Number(one.given[name].toPrecision(6))]));
    set({ ...known, ...(one.numbers.Q ? { Q: Number(one.numbers.Q.value.toPrecision(6)) } : {}) }, event);
  });
}

const chuteOf = ({ given }) => {
  const said = parameters.filter((name) => name in given).map((name) => `${name} ${Number(given[name].toPrecision(4))}`);
  return said.length ? `; ${said.join(", ")}` : "";
};

const drawn = () => all.filter((one) => one.shown).map((one) => ({ ...one, at: (symbol) => factor(symbol, one.given.slope ?? state.slope) }));

/** Points of a field over height, in the units that are shown: {x, y, across (the error of x), shape, colour, title}. */
export const profilePoints = (symbol) => drawn().flatMap(({ name, profiles, at, shape }) => {
  const { z = [], value = [], error } = profiles[symbol] ?? {};
  return z.map((height, i) => ({ x: value[i] * at(symbol), y: height * at("z"), across: error ? error[i] * at(symbol) : 0, shape, colour: colour("--curve"), title: name }));
});

/** Points of a quantity against the flux. */
export const curvePoints = (symbol) => drawn().flatMap(({ name, numbers, at, shape }) => {
  const [Q, value] = [numbers.Q, numbers[symbol]];
  if (!Q || !value) return [];
  return [{ x: Q.value * at("Q"), y: value.value * at(symbol), across: (Q.error ?? 0) * at("Q"), up: (value.error ?? 0) * at(symbol), shape, colour: colour("--curve"), title: name }];
});
