// Questions to the server, or to the data within a page that has no server.
import { answered, standalone } from "./standalone.js";

// How often a question is asked again that the server is too busy for, and after how many milliseconds.
const attempts = 10, pause = 300;
// Milliseconds after which the page says that it computes.
const slowAfter = 400;

/** The answer to a question, with its status if that is not 200; `signal` cancels it, which the server notices. */
export async function ask(question, query, signal) {
  if (standalone) return answered(question, query);
  for (let attempt = 1; ; attempt++) {
    let answer, status;
    try {
      const response = await fetch(`ask/${question}?${new URLSearchParams(query)}`, { signal, headers: { "x-status": "in-answer" } });
      answer = await response.json();
      status = answer.status ?? response.status;
    } catch (trouble) {
      if (signal?.aborted) throw trouble;
      return { error: "the server does not answer: is chuteflow explore still running?" };
    }
    if (status === 200) return answer;
    if (status !== 503 || attempt === attempts) return { ...answer, status };
    await new Promise((wake) => { setTimeout(wake, pause); });
    signal?.throwIfAborted();
  }
}

/** The answer to a file that is sent. */
export async function send(where, query, file) {
  try {
    const response = await fetch(`${where}?${new URLSearchParams(query)}`, { method: "POST", body: file, headers: { "x-status": "in-answer" } });
    return await response.json();
  } catch {
    return { error: "the server does not answer: is chuteflow explore still running?" };
  }
}

/** What can be set, cases and quantities. */
export const askAbout = async () => standalone?.about ?? (await fetch("about")).json();

/** One question of a kind is pending at a time; of those that arrive meanwhile, only the last is asked. */
export class Latest {
  /** `waits` (whether) is told when an answer takes long, and when it is there; `answered` takes the answer. */
  constructor(question, waits, answered) {
    this.question = question;
    this.waits = waits;
    this.answered = answered;
    this.busy = false;
    this.next = null;
  }

  ask(query, mark) {
    this.next = { query, mark };
    if (!this.busy) this.work();
  }

  async work() {
    this.busy = true;
    while (this.next) {
      const { query, mark } = this.next;
      this.next = null;
      const late = setTimeout(() => this.waits(true), slowAfter), answer = await ask(this.question, query);
      clearTimeout(late);
      this.waits(false);
      this.answered(answer, query, mark);
    }
    this.busy = false;
  }
}

/** Work that waits until the sliders rest: `start` (signal) is called `rest` milliseconds after the last `begin`, which cancels earlier work. */
export class Debounced {
  constructor(rest, start) {
    this.rest = rest;
    this.start = start;
    this.due = null;
    this.control = new AbortController();
  }

  begin() {
    this.stop();
    this.due = setTimeout(() => {
      const { signal } = this.control;
      this.start(signal).catch((trouble) => { if (!signal.aborted) throw trouble; });
    }, this.rest);
  }

  stop() {
    clearTimeout(this.due);
    this.control.abort();
    this.control = new AbortController();
  }
}
