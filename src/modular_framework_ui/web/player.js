// SPDX-License-Identifier: BSD-3-Clause
// Advances the shown time with the clock while a button says "Pause".

const PERIOD_MS = 100;

export class Player {
  /**
   * @param {HTMLElement} button Shows "Play" or "Pause".
   * @param {function(): number} end_s Returns the time at which the player stops [s].
   * @param {function(number): void} show Shows a time [s].
   */
  constructor(button, end_s, show) {
    Object.assign(this, { button, end_s, show, timer: null });
  }

  get isPlaying() {
    return this.timer !== null;
  }

  stop() {
    clearInterval(this.timer);
    this.timer = null;
    this.button.textContent = "Play";
  }

  /** Plays from a time [s]. */
  start(from_s) {
    const start_s = from_s - performance.now() / 1000;
    this.button.textContent = "Pause";
    this.timer = setInterval(() => {
      const next_s = start_s + performance.now() / 1000;
      if (next_s >= this.end_s()) this.stop();
      this.show(Math.min(next_s, this.end_s()));
    }, PERIOD_MS);
  }
}
