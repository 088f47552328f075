// The slider of a replay, and its playback.

import { clock, html, say } from "./shapes.js";

const SPEEDS = [1, 2, 5, 20, 100];

export class ReplayBar {
  /**
   * @param {HTMLElement} place the element of the slider.
   * @param {import("./stream.js").Stream} stream the stream that the slider controls.
   */
  constructor(place, stream) {
    Object.assign(this, { place, stream, playing: 0 });
    this.button = html("button", { type: "button", id: "play", "aria-label": "Play" }, "▶");
    this.slider = html("input", { type: "range", id: "time", min: 0, max: 1, step: 0.01, value: 0, "aria-label": "Time of the mission" });
    this.at = html("output", { id: "at" });
    this.speed = html("select", { id: "speed" }, ...SPEEDS.map((each) => html("option", { selected: each === 5 }, each)));
    place.append(this.button, this.slider, this.at, html("label", {}, "speed ", this.speed));
    this.button.addEventListener("click", () => this.play(!this.playing));
    this.slider.addEventListener("input", () => {
      this.play(false);
      const { value, max } = this.slider;
      // The slider's maximum is the end of the replay, rounded up.
      stream.go(value === max ? stream.end : Number(value));
    });
  }

  begin() {
    this.play(false);
    this.place.hidden = !this.stream.isReplay;
    // The maximum is a multiple of the step. Otherwise the slider could not reach it.
    this.slider.max = Math.ceil((this.stream.end ?? 0) * 100) / 100;
  }

  show() {
    const { place, shown, end } = this.stream;
    this.slider.value = place;
    this.slider.setAttribute("aria-valuetext", clock(place));
    say(this.at, `${clock(shown)} of ${clock(end)}`);
  }

  play(on) {
    say(this.button, on ? "⏸" : "▶");
    this.button.setAttribute("aria-label", on ? "Pause" : "Play");
    cancelAnimationFrame(this.playing);
    this.playing = 0;
    if (!on) return;
    if (this.stream.place >= this.stream.end) this.stream.go(0);
    let last = performance.now();
    const step = (now) => {
      this.stream.go(this.stream.place + ((now - last) / 1000) * Number(this.speed.value));
      last = now;
      if (this.stream.place >= this.stream.end) this.play(false);
      else this.playing = requestAnimationFrame(step);
    };
    this.playing = requestAnimationFrame(step);
  }

  /** Handle a key of the page; return whether the slider uses it. */
  key(event) {
    if (event.key !== " " || !this.stream.isReplay) return false;
    this.play(!this.playing);
    return true;
  }
}
