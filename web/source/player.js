// Player: the displayed time, its speed, and notification of changes.

const WHOLE = 24; // seconds in which a scene runs at the speed it begins with
const FASTEST = 6; // doublings of that speed, either way
const STEPS = 240; // of a scene, by the arrow keys

export class Player {
  constructor(start, end, changed) {
    Object.assign(this, { start, end, changed, time: start, playing: false, doublings: 0, last: null });
  }

  /** Seconds of the scene in one second. */
  get speed() {
    const plain = (this.end - this.start) / WHOLE || 1;
    const nice = plain >= 1 ? Math.max(1, Math.round(plain)) : plain;
    return nice * 2 ** this.doublings;
  }

  get step() {
    return (this.end - this.start) / STEPS;
  }

  go(time) {
    this.time = Math.min(this.end, Math.max(this.start, time));
    this.changed();
  }

  play(whether = !this.playing) {
    this.playing = whether;
    this.last = null;
    if (whether && this.time >= this.end) this.time = this.start;
    this.changed();
  }

  faster(doublings) {
    this.doublings = Math.min(FASTEST, Math.max(-FASTEST, this.doublings + doublings));
    this.changed();
  }

  /** Moves on to a time of the browser [ms]. */
  tick(now) {
    if (!this.playing) return;
    const passed = this.last === null ? 0 : Math.min(0.25, (now - this.last) / 1000);
    this.last = now;
    this.time += passed * this.speed;
    if (this.time >= this.end) [this.time, this.playing] = [this.end, false];
  }
}
