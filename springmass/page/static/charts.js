"use strict";
// The four charts. Colours are Okabe and Ito's, told apart by dashes too.
const COLOURS = { data: "#0072b2", fit: "#d55e00", rest: "#888888", others: ["#009e73", "#cc79a7", "#e69f00", "#56b4e9"] };
const DASHES = [[8, 4], [2, 3], [10, 3, 2, 3], [4, 2, 4, 6]];

// Of a logarithmic axis the powers of ten, with numbers that are never a rounded 0.
const powers = (_, splits) => splits.map((v) => (v !== null && Math.abs(Math.log10(v) - Math.round(Math.log10(v))) < 1e-9 ? v : null));
const plain = (_, splits) => splits.map((v) => (v === null ? "" : v > 9e-4 && v < 1e4 ? String(v) : v.toExponential(0).replace("-", "−")));

class Chart {
  constructor(id, series, labels, more) {
    this.box = document.getElementById(id);
    this.labels = labels;
    this.more = more || {};
    this.sizes = new ResizeObserver(() => this.plot.setSize(this.size()));
    this.sizes.observe(this.box);
    this.build(series);
    this.scheme = () => this.build(this.series);
    this.media = matchMedia("(prefers-color-scheme: dark)");
    this.media.addEventListener("change", this.scheme);
  }

  // A chart whose place another one takes follows neither size nor colours any more.
  destroy() {
    this.sizes.disconnect();
    this.media.removeEventListener("change", this.scheme);
    this.plot.destroy();
  }

  // A legend takes as many rows as it needs, and the chart what they leave.
  size() {
    const legend = this.plot && this.plot.root.querySelector(".u-legend");
    return { width: Math.max(this.box.clientWidth, 200), height: Math.max(this.box.clientHeight - ((legend && legend.offsetHeight) || 28), 120) };
  }

  build(series) {
    const data = this.plot ? this.plot.data : null, same = this.series && series.length === this.series.length;
    if (this.plot) this.plot.destroy();
    this.series = series;
    const style = getComputedStyle(document.documentElement);
    const ink = style.getPropertyValue("--ink").trim(), line = style.getPropertyValue("--line").trim();
    const log = this.more.scales && { filter: powers };
    const axis = (label, filter) => ({ label, stroke: ink, labelSize: 18, size: 46, font: "12px system-ui", labelFont: "12px system-ui", grid: { stroke: line + "44", width: 1, ...filter }, ticks: { stroke: line, width: 1, ...filter } });
    const options = {
      legend: { live: innerWidth > 700 },
      ...this.size(), series: [{ label: this.labels[0] }, ...series], scales: { x: { time: false } },
      axes: [{ ...axis(this.labels[0]), size: 34 }, { ...axis(this.labels[1], log), size: 56, ...(log && { ...log, values: plain }) }], ...this.more,
    };
    this.plot = new uPlot(options, data && same ? data : [[], ...series.map(() => [])], this.box);
    this.sizes.observe(this.plot.root.querySelector(".u-legend"));
  }

  show(data) { this.plot.setData(data); }
}

function points(label) { return { label, stroke: COLOURS.data, fill: COLOURS.data, points: { show: true, size: 5 }, paths: () => null }; }
function line(label, stroke, dash, width) { return { label, stroke, dash, width: width || 2, points: { show: false } }; }
