// The frames in time: play, step, jump.

const FRAMES_PER_S = 5;

export class Timeline {
  /** `show(index)` shows a frame and resolves when it is drawn. */
  constructor(element, numbers, show) {
    this.numbers = numbers;
    this.show = show;
    this.index = 0;
    this.isPlaying = false;
    this.slider = element.querySelector("input[type=range]");
    this.play = element.querySelector("[data-do=play]");
    this.label = element.querySelector("output");
    this.slider.max = numbers.length - 1;
    this.slider.addEventListener("input", () => this.go(Number(this.slider.value)));
    this.play.addEventListener("click", () => this.toggle());
    for (const [name, step] of [["back", -1], ["forward", 1]]) {
      element.querySelector(`[data-do=${name}]`).addEventListener("click", () => this.step(step));
    }
    if (numbers.length < 2) for (const part of element.querySelectorAll("button, input")) part.disabled = true;
  }

  async go(index) {
    this.index = Math.min(Math.max(index, 0), this.numbers.length - 1);
    this.slider.value = this.index;
    this.label.textContent = `frame ${this.numbers[this.index]} (${this.index + 1} of ${this.numbers.length})`;
    this.slider.setAttribute("aria-valuetext", this.label.textContent);
    await this.show(this.index);
  }

  step(by) {
    this.pause();
    return this.go((this.index + by + this.numbers.length) % this.numbers.length);
  }

  pause() {
    this.isPlaying = false;
    this.play.textContent = "Play";
  }

  async toggle() {
    if (this.isPlaying) {
      this.pause();
      return;
    }
    if (this.numbers.length < 2) return;
    this.isPlaying = true;
    this.play.textContent = "Pause";
    while (this.isPlaying) {
      const due = performance.now() + 1000 / FRAMES_PER_S;
      await this.go((this.index + 1) % this.numbers.length);
      await new Promise((done) => setTimeout(done, Math.max(0, due - performance.now())));
    }
  }
}
