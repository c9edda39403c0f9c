// Whether each flow is stable: asked one flow after another when the sliders rest, and shown as answers come.
import { ask, AtRest } from "./ask.js";
import { byId, escaped } from "./page.js";
import { chute, grains, state } from "./state.js";

let verdicts = [], count = 0, looking = false;

const asking = new AtRest(400, async (signal) => {
  const query = { ...chute(), Q: state.Q, ...grains() }, chosen = Math.min(Number(state.flow) || 0, count - 1);
  const order = [chosen, ...Array.from({ length: count }, (_, i) => i).filter((i) => i !== chosen)];
  for (const flow of order) {
    const answer = await ask("stability", { ...query, flow }, signal);
    signal.throwIfAborted();
    verdicts[flow] = answer.error ? { state: "unknown", says: `not known whether it is stable: ${answer.error}` } : answer;
    show();
  }
  looking = false;
});

/** Other flows are wanted: what is asked about those before is taken back. */
export function stop() {
  asking.stop();
  looking = false;
  show();
}

/** Other flows are there: `number` of them. */
export function restart(number) {
  verdicts = [];
  count = number;
  looking = count > 0;
  if (count) asking.begin();
}

/** Put what is known beside the flows. */
export function show() {
  byId("flows").querySelectorAll(".stability").forEach((place, i) => {
    const known = verdicts[i];
    place.innerHTML = known ? `<b>${escaped(known.says)}</b>${known.waves ? ` (${escaped(known.waves)})` : ""}` : looking ? "stability: looking for growing waves…" : "stability not looked at";
    place.dataset.state = known?.state ?? "";
  });
}
