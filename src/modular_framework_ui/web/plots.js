// SPDX-License-Identifier: BSD-3-Clause
// Plots of the joints over time, below the time line and with the same time axis and cursor.
/* global uPlot */

const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#b8860b", "#000000", "#7a7a7a"];
const MIN_HEIGHT_PX = 90;
const MAX_NAME_LENGTH = 13;
const QUANTITIES = {
  position: { title: "Position", unit: "rad or m" },
  velocity: { title: "Velocity", unit: "rad/s or m/s" },
  effort: { title: "Effort", unit: "N m or N" },
  error: { title: "Tracking error", unit: "rad or m" },
};

/** Draws a plot for each chosen quantity. */
export class Plots {
  /**
   * @param {HTMLElement} parent Element of the plots.
   * @param {function(?number): void} onCursor Function that receives the time at the mouse [s]; null beside the plots.
   */
  constructor(parent, onCursor) {
    this.parent = parent;
    this.onCursor = onCursor;
    this.joints = [];
    this.samples = [];
    this.shown = [];
    this.axis = { total_s: 1, left: 0, right: 0 };
    this.plots = new Map();
    this.cursor_s = null;
  }

  /** Chooses the quantities. */
  show(quantities) {
    this.shown = Object.keys(QUANTITIES).filter((key) => quantities.includes(key));
    this.build();
  }

  /** Sets the samples, with times since the start of the task [s]. */
  setSamples(joints, samples) {
    this.samples = samples;
    if (joints.join() === this.joints.join()) {
      for (const [key, plot] of this.plots) plot.setData(this.dataOf(key));
      return;
    }
    this.joints = joints;
    this.build();
  }

  /** Sets the length of the time axis [s] and its distances from the left and right edge [px]. */
  setAxis(total_s, left, right) {
    const isMoved = left !== this.axis.left || right !== this.axis.right;
    const isLonger = total_s !== this.axis.total_s;
    this.axis = { total_s, left, right };
    if (isMoved) this.build();
    else if (isLonger) for (const plot of this.plots.values()) plot.setScale("x", { min: 0, max: total_s }); // redraws
  }

  /** Moves the cursor to a time [s]; null hides the cursor. */
  setCursor(time_s) {
    this.cursor_s = time_s;
    for (const plot of this.plots.values()) {
      const left = time_s === null ? -10 : plot.valToPos(time_s, "x");
      plot.setCursor({ left, top: time_s === null ? -10 : 0 }, false);
    }
  }

  /** Builds all plots; also after a change of the size. */
  build() {
    for (const plot of this.plots.values()) plot.destroy();
    this.plots.clear();
    this.parent.hidden = this.shown.length === 0 || this.joints.length === 0;
    const width = this.parent.clientWidth;
    if (this.parent.hidden || width <= this.axis.left + this.axis.right) return;
    const height = Math.max(MIN_HEIGHT_PX, Math.floor(this.parent.clientHeight / this.shown.length));
    for (const key of this.shown) {
      const plot = new uPlot({ width, height, ...this.optionsOf(key) }, this.dataOf(key), this.parent);
      // uPlot's hook setCursor also reports a cursor that a new size or new data removes
      plot.over.addEventListener("mousemove", (event) => this.onCursor(timeAt(plot, event)));
      plot.over.addEventListener("mouseleave", () => this.onCursor(null));
      this.plots.set(key, plot);
    }
    queueMicrotask(() => this.setCursor(this.cursor_s)); // after uPlot has set the scales
  }

  dataOf(key) {
    return [this.samples.map((sample) => sample.time_s), ...this.joints.map((_, joint) => this.samples.map((sample) => sample[key][joint]))];
  }

  optionsOf(key) {
    const { title, unit } = QUANTITIES[key];
    const { left, right } = this.axis;
    const font = "11px sans-serif";
    const line = { stroke: "#e0e4e8", width: 1 };
    return {
      padding: [6, right, 0, 0],
      cursor: { sync: { key: "time" }, drag: { x: false, y: false }, y: false, points: { size: 5 } },
      scales: { x: { time: false, range: () => [0, this.axis.total_s] } },
      axes: [
        { size: 4, values: () => [], ticks: { show: false }, grid: line },
        { size: left, font, grid: line, ticks: { size: 4, stroke: "#c4ccd4" }, space: 22, values: (_, splits) => splits.map((value) => String(Number(value.toPrecision(3)))) },
      ],
      series: [
        { label: `${title} [${unit}]` },
        ...shortNames(this.joints).map((label, index) => ({
          label,
          stroke: COLOURS[index % COLOURS.length],
          dash: index < COLOURS.length ? undefined : [5, 3],
          width: 1.5,
          spanGaps: true,
          points: { show: false },
          value: (_, value) => valueText(value),
        })),
      ],
    };
  }
}

function valueText(value) {
  if (value === null || value === undefined) return "–";
  return value !== 0 && Math.abs(value) < 5e-4 ? value.toExponential(0) : value.toFixed(3);
}

/** Returns the time at the mouse over a plot [s]. */
function timeAt(plot, event) {
  return plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x");
}

/** Returns names of joints without the word "joint" at the end and without the prefix of a long name. */
function shortNames(joints) {
  return joints.map((joint) => {
    const name = joint.replace(/_?joint$/, "") || joint;
    return name.length <= MAX_NAME_LENGTH ? name : `…${name.slice(1 - MAX_NAME_LENGTH)}`;
  });
}
