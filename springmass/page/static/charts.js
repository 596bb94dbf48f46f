"use strict";
// Charts. Lines differ by dashes as well as by colour; every colour has a contrast of at least 4.5 to 1.
const DASHES = [[8, 4], [2, 3], [10, 3, 2, 3], [4, 2, 4, 6]];
const COLOURS = {}, OTHERS = ["other-1", "other-2", "other-3", "other-4"];

function take_colours() {
  const style = getComputedStyle(document.documentElement), of = (name) => style.getPropertyValue(`--${name}`).trim();
  for (const name of ["ink", "line", "data", "fit", "rest", ...OTHERS]) COLOURS[name] = of(name);
}

// A logarithmic axis is labelled only at powers of ten, with numbers that are never rounded to 0.
const powers = (_, splits) => splits.map((v) => (v !== null && Math.abs(Math.log10(v) - Math.round(Math.log10(v))) < 1e-9 ? v : null));
const plain = (_, splits) => splits.map((v) => (v === null ? "" : v > 9e-4 && v < 1e4 ? String(v) : v.toExponential(0).replace("-", "−")));

// The key of a series in the legend looks like the series: a line with its dashes, a dot or a ring.
function key_of(plot, i) {
  const series = plot.series[i], ink = series.stroke(plot, i);
  if (series.key === "dot") return `radial-gradient(circle, ${ink} 0 3px, transparent 3.5px)`;
  if (series.key === "ring") return `radial-gradient(circle, transparent 0 2px, ${ink} 2.5px 3.5px, transparent 4px)`;
  let at = 0;
  const stops = (series.dash || [1]).map((length, k) => `${k % 2 ? "transparent" : ink} ${at}px ${(at += length)}px`);
  return `repeating-linear-gradient(90deg, ${stops.join(", ")}) center / 100% 2px no-repeat`;
}
const LEGEND = { live: false, markers: { width: 0, fill: key_of } };

class Chart {
  constructor(id, series, labels, more, log) {
    this.box = document.getElementById(id);
    this.labels = labels;
    this.more = more || {};
    this.log = log;
    this.sizes = new ResizeObserver(() => { if (this.box.clientWidth) this.plot.setSize(this.size()); });
    this.sizes.observe(this.box);
    this.build(series);
    this.scheme = () => this.build(this.series);
    this.media = matchMedia("(prefers-color-scheme: dark)");
    this.media.addEventListener("change", this.scheme);
  }

  // Stop a replaced chart from following changes of size and colour scheme.
  destroy() {
    this.sizes.disconnect();
    this.media.removeEventListener("change", this.scheme);
    this.plot.destroy();
  }

  // A legend takes as many rows as it needs; the chart takes the height that remains.
  size() {
    const legend = this.plot && this.plot.root.querySelector(".u-legend");
    return { width: Math.max(this.box.clientWidth, 200), height: Math.max(this.box.clientHeight - (legend ? legend.offsetHeight || 28 : this.plot ? 0 : 28), 120) };
  }

  build(series) {
    const data = this.plot ? this.plot.data : null, same = this.series && series.length === this.series.length;
    if (this.plot) this.plot.destroy();
    this.series = series;
    take_colours();
    const { ink, line } = COLOURS, log = this.log && { filter: powers };
    const axis = (label, filter) => ({ label, stroke: ink, labelSize: 18, size: 46, font: "12px system-ui", labelFont: "12px system-ui", grid: { stroke: line + "44", width: 1, ...filter }, ticks: { stroke: line, width: 1, ...filter } });
    const options = {
      legend: LEGEND,
      ...this.size(), series: [{ label: this.labels[0] }, ...series], scales: { x: { time: false } },
      axes: [{ ...axis(this.labels[0]), size: 34 }, { ...axis(this.labels[1], log), size: 56, space: 20, ...(log && { ...log, values: plain }) }], ...this.more,
    };
    this.plot = new uPlot(options, data && same ? data : [[], ...series.map(() => [])], this.box);
    const legend = this.plot.root.querySelector(".u-legend");
    if (legend) this.sizes.observe(legend);
  }

  show(data) { this.plot.setData(data); }
}

const colour = (name) => () => COLOURS[name];
function points(label, size) { return { label, key: "dot", stroke: colour("data"), points: { show: true, size: size || 5, stroke: colour("data"), fill: colour("data") }, paths: () => null }; }
function line(label, name, dash, width) { return { label, stroke: colour(name), dash, width: width || 2, points: { show: false } }; }

// Samples that are far enough apart are drawn as dots, so that the fit below is visible; denser ones are drawn as a
// line.
const joined = uPlot.paths.linear();
const dense = (plot, first, last) => (last - first) * devicePixelRatio > 1.5 * plot.bbox.width;
function samples_series() {
  return {
    label: "samples", key: "dot", stroke: colour("data"), width: 1,
    paths: (plot, series, first, last) => (dense(plot, first, last) ? joined(plot, series, first, last) : null),
    points: { show: (plot, series, first, last) => !dense(plot, first, last), size: 3, stroke: colour("data"), fill: colour("data") },
  };
}
