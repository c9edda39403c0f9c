// Questions to the server.

/** The answer to a question; `signal` takes it back, which the server notices. */
export async function ask(question, query, signal) {
  for (;;) {
    let answer, status;
    try {
      const response = await fetch(`ask/${question}?${new URLSearchParams(query)}`, { signal });
      status = response.status;
      answer = await response.json();
    } catch (trouble) {
      if (signal?.aborted) throw trouble;
      return { error: "the server does not answer: is chuteflow explore still running?" };
    }
    if (status !== 503) return answer;
    await new Promise((wake) => { setTimeout(wake, 300); });
  }
}

/** One question of a kind is under way at a time; of those that come meanwhile, only the last is asked. */
export class Latest {
  constructor(question, answered) {
    this.question = question;
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
      this.answered(await ask(this.question, query), query, mark);
    }
    this.busy = false;
  }
}

/** Work for when the sliders rest: `start` (signal) is called a while after the last `begin`, which ends earlier work. */
export class AtRest {
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
