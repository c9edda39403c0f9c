// The state of the page is its address: whoever opens a copied address sees the same.

const listeners = [];
const material = ["slope", "e", "ew", "roughness", "surface", "closure"];
const defaults = {
  si: "", d: "1", rho: "2500", theme: "", flow: "0", against: "h", whole: "", x: "slope", y: "roughness", shade: "most",
};
// What can be chosen from few; numbers and names of the chute are checked by the server, which says what is wrong.
const parameters = ["slope", "e", "ew", "roughness"];
const allowed = {
  si: ["", "1"], whole: ["", "1"], theme: ["", "light", "dark"], against: ["h", "M", "T_surface"], x: parameters, y: parameters,
  shade: ["most", "families", "density", "interior"],
};
let first = {}, due = null;
export const state = {};

/** Take the state of the address, over the defaults and over `preset`. */
export function start(preset) {
  first = { ...defaults, ...Object.fromEntries(Object.entries(preset).map(([name, value]) => [name, String(value)])) };
  Object.assign(state, fromAddress());
}

function fromAddress() {
  const given = new URLSearchParams(location.search), known = (name) => given.has(name) && (allowed[name]?.includes(given.get(name)) ?? true);
  const taken = Object.fromEntries(Object.entries(first).map(([name, value]) => [name, known(name) ? given.get(name) : value]));
  return taken.x === taken.y ? { ...taken, x: defaults.x, y: defaults.y } : taken;
}

/** Change parts of the state, tell the listeners which, and put it into the address. */
export function change(parts) {
  const changed = Object.keys(parts).filter((name) => state[name] !== String(parts[name]));
  if (!changed.length) return;
  for (const name of changed) state[name] = String(parts[name]);
  for (const listen of listeners) listen((...names) => names.some((name) => changed.includes(name)));
  // Browsers allow some hundred changes of the address in half a minute: wait until a drag pauses.
  clearTimeout(due);
  due = setTimeout(write, 120);
}

addEventListener("popstate", () => change(fromAddress()));

/** `listen` is called after each change with a function that tells whether any of some names changed. */
export function onChange(listen) { listeners.push(listen); }

export function address() {
  const shown = Object.entries(state).filter(([name, value]) => defaults[name] !== value);
  return `${location.pathname}?${new URLSearchParams(shown)}`;
}

export function write() {
  clearTimeout(due);
  history.replaceState(null, "", address());
}

/** The parameters of the chute, for a question. */
export const chute = () => Object.fromEntries(material.map((name) => [name, state[name]]));

/** The grains, for a question whose answer has words: SI units are wanted where they are given. */
export const grains = () => (state.si ? { diameter: String(Number(state.d) / 1000), density: state.rho } : {});

/** Whether the chute itself changed. */
export const ofChute = (has) => has(...material);

/** Whether what is drawn must be drawn anew though no answer changed. */
export const ofLooks = (has) => has("si", "d", "rho", "theme");
