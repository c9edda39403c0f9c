// Questions to the server. One at a time of each kind is under way; of those that wait, only the last is asked.

export class Latest {
  constructor(question, answered) { this.question = question; this.answered = answered; this.busy = false; this.next = null; }

  ask(query, mark) {
    this.next = { query, mark };
    if (!this.busy) this.work();
  }

  async work() {
    this.busy = true;
    while (this.next) {
      const { query, mark } = this.next;
      this.next = null;
      let answer;
      try {
        const response = await fetch(`ask/${this.question}?${new URLSearchParams(query)}`);
        answer = await response.json();
        if (response.status === 503) {
          await new Promise((wake) => setTimeout(wake, 300));
          this.next ??= { query, mark };
          continue;
        }
      } catch {
        answer = { error: "the server does not answer: is chuteflow explore still running?" };
      }
      this.answered(answer, query, mark);
    }
    this.busy = false;
  }
}
