// Whether flows are stable: asked one after another when the sliders rest, those at the flux before those of the curve,
// and shown as answers come.
import { ask, AtRest } from "./ask.js";
import * as curve from "./curve.js";
import { kept } from "./kept.js";
import { byId, escaped } from "./page.js";
import { chute, grains, state } from "./state.js";

let verdicts = [], count = 0, looking = false;

const asking = new AtRest(400, async (signal) => {
  const query = { ...chute(), ...grains() }, chosen = Math.min(Number(state.flow) || 0, count - 1);
  const verdict = async (which) => {
    const answer = await ask("stability", { ...query, ...which }, signal);
    signal.throwIfAborted();
    return answer.error ? { state: "unknown", says: `not known whether it is stable: ${answer.error}` } : answer;
  };
  const order = [chosen, ...Array.from({ length: count }, (_, i) => i).filter((i) => i !== chosen)];
  for (const flow of order.filter((i) => i >= 0 && !verdicts[i])) {
    verdicts[flow] = await verdict({ Q: state.Q, flow });
    show();
  }
  looking = false;
  for (let [next] = curve.unjudged(); next; [next] = curve.unjudged()) {
    const known = await verdict({ branch: next.branch, point: next.point });
    curve.judge(next, known);
    // Where the question cannot be posed, it cannot for any flow of the curve.
    if (known.state === "unknown" && known.reason && !known.searched) break;
  }
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
  looking = count > 0 && !kept;
  again();
}

/** Go on with what is not known yet. */
export function again() { if (!kept) asking.begin(); }

/** Put what is known beside the flows. */
export function show() {
  byId("flows").querySelectorAll(".stability").forEach((place, i) => {
    const known = verdicts[i];
    place.innerHTML = known ? `<b>${escaped(known.says)}</b>${known.waves ? ` (${escaped(known.waves)})` : ""}` : looking ? "stability: looking for growing waves…" : "stability not looked at";
    place.dataset.state = known?.state ?? "";
  });
}
