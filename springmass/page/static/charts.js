"use strict";
// The four charts. Colours are Okabe and Ito's, told apart by dashes too.
const COLOURS = { data: "#0072b2", fit: "#d55e00", rest: "#888888", others: ["#009e73", "#cc79a7", "#e69f00", "#56b4e9"] };
const DASHES = [[8, 4], [2, 3], [10, 3, 2, 3], [4, 2, 4, 6]];

class Chart {
  constructor(id, series, labels, more) {
    this.box = document.getElementById(id);
    this.labels = labels;
    this.more = more || {};
    this.build(series);
    this.sizes = new ResizeObserver(() => this.plot.setSize(this.size()));
    this.sizes.observe(this.box);
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

  size() { return { width: Math.max(this.box.clientWidth, 200), height: Math.max(this.box.clientHeight - 28, 120) }; }

  build(series) {
    const data = this.plot ? this.plot.data : null, same = this.series && series.length === this.series.length;
    if (this.plot) this.plot.destroy();
    this.series = series;
    const style = getComputedStyle(document.documentElement);
    const ink = style.getPropertyValue("--ink").trim(), line = style.getPropertyValue("--line").trim();
    const axis = (label) => ({ label, stroke: ink, labelSize: 18, size: 46, font: "12px system-ui", labelFont: "12px system-ui", grid: { stroke: line + "44", width: 1 }, ticks: { stroke: line, width: 1 } });
    const options = {
      ...this.size(), series: [{ label: this.labels[0] }, ...series], scales: { x: { time: false } },
      axes: [{ ...axis(this.labels[0]), size: 34 }, { ...axis(this.labels[1]), size: 56 }], ...this.more,
    };
    this.plot = new uPlot(options, data && same ? data : [[], ...series.map(() => [])], this.box);
  }

  show(data) { this.plot.setData(data); }
}

function points(label) { return { label, stroke: COLOURS.data, fill: COLOURS.data, points: { show: true, size: 5 }, paths: () => null }; }
function line(label, stroke, dash, width) { return { label, stroke, dash, width: width || 2, points: { show: false } }; }
