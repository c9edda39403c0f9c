// Measurements and particle simulations, drawn behind the flows.
import { send } from "./ask.js";
import { byId, colour, escaped } from "./page.js";
import { standalone } from "./standalone.js";
import { grains, state } from "./state.js";
import { factor } from "./units.js";

const shapes = ["circle", "diamond", "triangle"], symbols = ["○", "◇", "▽"];
const parameters = ["slope", "e", "ew", "roughness"];
// Flows that are drawn, at most, and bytes of a file that the server reads.
const most = 40, largest = 2e6;
let all = [], set = null, listen = null;

/** Add flows to those that are drawn. */
function add(data) {
  const before = all.length;
  all.push(...data.map((one, i) => ({ ...one, shown: true, shape: shapes[(before + i) % shapes.length] })));
  byId("data").hidden = !all.length;
  byId("data").insertAdjacentHTML("beforeend", all.slice(before).map((one, n) => [one, before + n]).map(([one, i]) => `<li><label><input type="checkbox" data-measured="${i}" checked> ${symbols[i % shapes.length]} <b>${escaped(one.name)}</b></label>
    <span class="quiet">${escaped(one.what)}${escaped(chuteOf(one))}</span> ${parameters.some((name) => name in one.given) ? `<button type="button" data-chute="${i}" aria-label="show the chute of ${escaped(one.name)}">its chute</button>` : ""}</li>`).join(""));
}

/** What the server reads in a file, or what is wrong with it in its error. */
async function read(file) {
  if (file.size > largest) return { error: `${file.name}: has more than ${largest / 1e6} MB` };
  return send("data", { name: file.name, slope: state.slope, ...grains() }, file);
}

/** Load files one after another; one that cannot be read is named, and the others are drawn. */
async function load(files) {
  const said = [], before = all.length;
  byId("load-words").textContent = "reading ...";
  for (const file of files) {
    const { data, error } = await read(file);
    if (error) said.push(error.replace(/\.?$/, "."));
    else if (all.length + data.length > most) said.push(`${file.name}: ${most} flows can be drawn at most.`);
    else add(data);
  }
  const loaded = all.length - before;
  if (loaded) said.unshift(`${loaded} measured ${loaded === 1 ? "flow is" : "flows are"} drawn.`);
  byId("load-words").textContent = said.join(" ");
  byId("load-words").classList.toggle("wrong", said.length > (loaded ? 1 : 0));
  if (loaded) listen();
}

/** What is drawn, for a page that needs no server. */
export const shown = () => all.filter((one) => one.shown).map(({ shown: _, shape: __, ...one }) => one);

/** `data` are the flows that were measured; `setter` (parts, event) changes the state, `listener` is called when others are shown. */
export function begin(data, setter, listener) {
  set = setter;
  listen = listener;
  add(data);
  byId("load").addEventListener("change", (event) => {
    load([...event.target.files]);
    // The same file may be chosen again once it is corrected.
    event.target.value = "";
  });
  addEventListener("dragover", (event) => { if (event.dataTransfer?.types.includes("Files")) event.preventDefault(); });
  addEventListener("drop", (event) => {
    if (standalone || !event.dataTransfer?.files.length) return;
    event.preventDefault();
    load([...event.dataTransfer.files]);
  });
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

const drawn = () => all.filter((one) => one.shown).map((one) => ({ ...one, at: (symbol) => factor(symbol, one.slope ?? state.slope) }));

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
