// The page: the state changes, questions are asked, and the panels are redrawn when answers come.
import { ask, askAbout, Debounced, Latest } from "./ask.js";
import { number } from "./chart.js";
import { makeControls, showControls } from "./controls.js";
import * as curve from "./curve.js";
import * as chutePicture from "./grains.js";
import { standalone } from "./standalone.js";
import * as map from "./map.js";
import { byId, download, escaped, flowColour, forgetColours, sentence, showMessage } from "./page.js";
import * as measurements from "./measured.js";
import * as pins from "./pins.js";
import { drawBudget, drawProfiles } from "./profiles.js";
import * as stability from "./stability.js";
import * as story from "./story.js";
import { address, canRedo, canUndo, change, chute, grains, ofChute, ofLooks, onChange, onSteps, redo, settle, start, state, undo, write } from "./state.js";
import { factor, setQuantities, unit } from "./units.js";

const about = await askAbout();
setQuantities(about.quantities);
start({ ...about.presets[0].state, ...about.first }, about.fixed);
byId("version").textContent = about.version;

let flows = null, mark = 0, restDue = false;
const chosen = () => Math.max(0, Math.min(Number(state.flow) || 0, (flows?.flows.length ?? 1) - 1));

/** Change the state because of `event`, whose time the redraw is measured from. What is done with one click is a step of its own. */
function set(parts, event) {
  const alone = event?.type === "change" || event?.type === "click";
  mark = event?.timeStamp ?? performance.now();
  if (alone) settle();
  change(parts);
  if (alone) settle();
}

// --- answers ----------------------------------------------------------------------------------------------------

/** Whether a panel waits for an answer, shown after a while. */
const waits = (panel) => (waiting) => byId(panel).setAttribute("aria-busy", String(waiting));

/** The limits of the theory take longer to compute than the curve itself: they are asked for when the sliders rest. */
const limits = new Debounced(150, async (signal) => {
  const answer = await ask("limits", chute(), signal);
  signal.throwIfAborted();
  if (!answer.error) curve.takeLimits(answer.words);
});

const asks = {
  flows: new Latest("flows", waits("words"), (answer, query, since) => take(answer, "flows", since, () => {
    flows = answer.error ? { ...answer, top: 1, says: sentence(answer.error) } : answer;
    const held = curve.heldFlow(flows.flows);
    if (held !== null) change({ flow: held });
    stability.restart(flows.flows.length);
    showFlows();
  })),
  curve: new Latest("curve", waits("curve-panel"), (answer, query, since) => take(answer, "curve", since, () => {
    curve.takeCurve(answer);
    if (!answer.error) limits.begin();
    stability.again();
  })),
};

const refused = {};

/** Use an answer, or say what went wrong and that the panels belong to previous values. */
function take(answer, name, since, use) {
  // A part that is left out is named in its panel, which then shows nothing of previous values.
  const leftOut = answer.status === 422;
  refused[name] = Boolean(answer.error) && !leftOut;
  showMessage(name, refused[name] ? `${answer.error.replace(/\.$/, "")}.${flows ? " What is shown below belongs to the previous values." : ""}` : "");
  document.querySelector("main").classList.toggle("outdated", Object.values(refused).includes(true));
  if (refused[name]) return;
  use();
  measured(name, since);
}

let measures = 0;

/** Time from the event until the frame with the new drawing is painted, on the browser's performance timeline. */
function measured(name, since) {
  if (++measures % 1000 === 0) performance.clearMeasures();
  // What is queued in the frame's callback runs after its paint.
  requestAnimationFrame(() => setTimeout(() => performance.measure(`${name}-redraw`, { start: since, end: performance.now() })));
}

function askFlows() {
  stability.stop();
  asks.flows.ask({ ...chute(), Q: state.Q, ...grains() }, mark);
}
function askCurve() {
  limits.stop();
  asks.curve.ask({ ...chute(), ...grains() }, mark);
}

onChange((has) => {
  if (has("theme")) {
    document.documentElement.dataset.theme = state.theme;
    forgetColours();
  }
  const words = has("si", "d", "rho");
  if (ofChute(has) || has("Q")) chutePicture.pauseBriefly();
  if (ofChute(has) || has("Q") || words) askFlows();
  if (ofChute(has) || words) askCurve();
  showControls();
  if (has("Q", "against", "whole", "stability")) curve.redraw();
  if (has("against", "whole", "stability")) stability.again();
  if (has("pin")) pins.load();
  if (has("story")) story.show();
  if (has("flow") || ofLooks(has)) showFlows();
  if (!standalone) map.changed(has);
});

// --- flows --------------------------------------------------------------------------------------------------------

const beyond = (flow) => (flow.validity.words.length ? `<span class="beyond">${escaped(flow.validity.words.join(", "))}</span>` : "");
const shown = (symbol, value) => `${symbol.replace(/_(.*)/, "<sub>$1</sub>")} ${number(value * factor(symbol))}${unit(symbol) ? ` ${unit(symbol)}` : ""}`;

const row = (flow, i) => `<label><input type="radio" name="flow" value="${i}"${i === chosen() ? " checked" : ""}>
  <svg class="swatch" viewBox="0 0 2 2" aria-hidden="true"><circle cx="1" cy="1" r="1" fill="${flowColour(i)}"/></svg>
  <span><b>${escaped(flow.name)}</b> ${beyond(flow)} <span class="numbers">${["h", "M", "T_surface"].map((symbol) => shown(symbol, flow[symbol])).join(" · ")} · error ${flow.error.toExponential(0)}</span>
  <span class="quiet">${escaped(flow.kinds)}; <span class="stability"></span></span></span></label>`;

/** All panels that show the flows at the flux. */
function showFlows() {
  if (!flows) return;
  const list = flows.flows, k = chosen(), focused = byId("flows").contains(document.activeElement);
  byId("says").textContent = flows.says;
  byId("flows").innerHTML = list.map(row).join("");
  if (focused) byId("flows").querySelector("input:checked")?.focus();
  stability.show();
  pins.show();
  drawProfiles(list, flows.top, k, pins.pinned());
  curve.takeFlows(list, k);
  showRestLater();
}

/** The rest is drawn a frame later, once for several answers, so that flows and profiles follow the slider without delay. */
function showRestLater() {
  if (restDue) return;
  restDue = true;
  requestAnimationFrame(() => setTimeout(() => { restDue = false; showRest(); }, 30));
}

/** Panels of the chosen flow alone, and how to compute it. */
function showRest() {
  const flow = flows.flows[chosen()] ?? null;
  chutePicture.show(flow, flows.chute.slope, flowColour(chosen()));
  drawBudget(flow, chosen());
  byId("command").textContent = flows.recipes.command;
  byId("python").textContent = flows.recipes.python;
}

byId("flows").addEventListener("change", (event) => set({ flow: event.target.value }, event));

// --- exports -----------------------------------------------------------------------------------------------------

/** A link to what the server makes of the state at the time of the click. */
function exported(link, what, format) {
  const refresh = () => { link.href = `ask/export?${new URLSearchParams({ ...chute(), Q: state.Q, ...grains(), what, format })}`; };
  link.addEventListener("click", refresh);
  link.addEventListener("focus", refresh);
}

/** Tables and pictures that the server makes. */
for (const [what, title] of [["profiles", "Profiles of all fields"], ["curve", "Curve of all flows"]]) {
  const item = document.createElement("li");
  item.className = "served";
  item.append(`${title}: `);
  for (const format of ["csv", "svg", "png"]) {
    const link = Object.assign(document.createElement("a"), { textContent: format.toUpperCase(), download: "", href: "#" });
    link.dataset.export = `${what}-${format}`;
    exported(link, what, format);
    item.append(link, " ");
  }
  byId("exports").append(item);
}
const picture = document.createElement("li");
picture.append("Picture of the chute: ");
for (const kind of ["svg", "png"]) {
  const button = Object.assign(document.createElement("button"), { type: "button", textContent: kind.toUpperCase() });
  button.dataset.export = `chute-${kind}`;
  button.addEventListener("click", () => chutePicture.save(kind));
  picture.append(button, " ");
}
byId("exports").append(picture);
const whole = document.createElement("li");
whole.className = "served";
whole.innerHTML = 'This chute at every flux, as one page that needs no server: <a href="#" download data-export="page-html">HTML</a>';
exported(whole.querySelector("a"), "page", "html");
byId("exports").append(whole);
whole.querySelector("a").addEventListener("click", async (event) => {
  const data = measurements.shown();
  if (!data.length) return;
  // The server does not know what was loaded here: it is put into the page that the server makes.
  event.preventDefault();
  showMessage("export", "");
  const page = await (await fetch(event.target.href)).text();
  const place = /(<script type="application\/json" id="standalone-data">)([^<]*)(<\/script>)/;
  if (!place.test(page)) { showMessage("export", "The page that needs no server is left out: ask again, or use chuteflow explore --export."); return; }
  const filled = page.replace(place, (_, begin, content, end) => {
    const parts = JSON.parse(content);
    parts.about.data = data;
    return begin + JSON.stringify(parts).replaceAll("<", "\\u003c") + end;
  });
  download("chuteflow.html", new Blob([filled], { type: "text/html" }));
});

for (const what of ["address", "command", "python"]) byId(`copy-${what}`).addEventListener("click", async () => {
  write();
  try {
    await navigator.clipboard.writeText(what === "address" ? new URL(address(), location.href).href : byId(what).textContent);
    byId("copied").textContent = "copied";
  } catch { byId("copied").textContent = "the browser does not let this page copy: select the text"; }
  setTimeout(() => { byId("copied").textContent = ""; }, 2500);
});

// --- steps back and forth ---------------------------------------------------------------------------------------

for (const [id, step] of [["undo", undo], ["redo", redo]]) byId(id).addEventListener("click", step);
function showSteps() {
  for (const [id, can] of [["undo", canUndo()], ["redo", canRedo()]]) byId(id).setAttribute("aria-disabled", String(!can));
}
onSteps(showSteps);
addEventListener("keydown", (event) => {
  const key = event.key.toLowerCase(), step = key === "y" || event.shiftKey ? redo : undo;
  if (!(event.ctrlKey || event.metaKey) || event.altKey || (key !== "z" && key !== "y")) return;
  // A number that is being typed has its own undo.
  const { dataset, value } = event.target;
  if (dataset.shown !== undefined && dataset.shown !== value) return;
  event.preventDefault();
  step();
});

// --- the beginning ----------------------------------------------------------------------------------------------

document.documentElement.dataset.theme = state.theme;
makeControls(about, set);
showControls();
showSteps();
curve.begin(set, about.validity);
measurements.begin(about.data, set, () => {
  showFlows();
  curve.redraw();
});
pins.begin(set, () => {
  showFlows();
  curve.redraw();
}, chosen);
story.begin(set);
if (standalone) showStandaloneWords(standalone.says);
else map.begin(about, set);
/** The contents of a page that needs no server: below the flux, or at the end of a small page. */
function showStandaloneWords(says) {
  const words = document.createElement("section");
  words.id = "standalone-words";
  words.innerHTML = `<h2>About this page</h2>${says.map((text) => `<p>${escaped(sentence(text))}</p>`).join("")}`;
  (innerWidth > 700 ? byId("sliders") : document.querySelector("main")).append(words);
}
function redraw() {
  forgetColours();
  showFlows();
  if (!standalone) map.redraw();
}
new ResizeObserver(redraw).observe(document.querySelector("main"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
mark = performance.now();
askFlows();
askCurve();
