// The engine behind a page: any line, and the whole scan from any viewpoint. A served page asks its
// server, and a page in a notebook's iframe asks the widget around it.

const waiting = new Map();

addEventListener("message", (event) => {
  const answer = event.source === parent ? event.data?.intervis : undefined;
  if (!waiting.has(answer?.id)) return;
  const [resolve, reject] = waiting.get(answer.id);
  waiting.delete(answer.id);
  if (answer.error === undefined) resolve(answer.answer);
  else reject(new Error(answer.error));
});

function askWidget(kind, question) {
  return new Promise((resolve, reject) => {
    const id = crypto.getRandomValues(new Uint32Array(1))[0];
    waiting.set(id, [resolve, reject]);
    parent.postMessage({ intervis: { id, kind, question } }, "*");
  });
}

async function ask(path, question) {
  if (location.href === "about:srcdoc") return askWidget(path, question);
  const response = await fetch(path, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(question),
  });
  const answer = await response.json();
  if (!response.ok) throw new Error(answer.error);
  return answer;
}

/** The line between two places of a frame, as Python explains it. */
export function askLine(frame, start, end) {
  return ask("line", { frame, from: start, to: end });
}

/** Judges the returns of a frame from a viewpoint; while one request runs, only the latest waits. */
export class Judge {
  constructor(onAnswer, onError) {
    this.onAnswer = onAnswer;
    this.onError = onError;
    this.waiting = null;
    this.isBusy = false;
  }

  async request(frame, viewpoint) {
    this.waiting = { frame, from: viewpoint };
    if (this.isBusy) return;
    this.isBusy = true;
    while (this.waiting) {
      const question = this.waiting;
      this.waiting = null;
      try {
        await this.onAnswer(question.frame, await ask("judge", question));
      } catch (error) {
        this.onError(error.message);
      }
    }
    this.isBusy = false;
  }
}
