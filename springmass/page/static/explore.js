"use strict";
// Zoom, pan and read a chart: shared by the page of a recording and by reports. Needs charts.js.

const ZOOM = 0.5, PAN = 0.25;

// The range of the time axis after a button is pressed, limited to the range of the data.
function shifted([low, high], [first, last], action) {
  const wide = high - low, middle = (low + high) / 2;
  if (action === "all") return [first, last];
  if (action === "in") return [middle - wide * ZOOM / 2, middle + wide * ZOOM / 2];
  if (action === "out") return [Math.max(first, middle - wide / ZOOM / 2), Math.min(last, middle + wide / ZOOM / 2)];
  const by = Math.max(first - low, Math.min(last - high, (action === "left" ? -PAN : PAN) * wide));
  return [low + by, high + by];
}

// Gives charts with a common x axis the same range, and buttons that change it.
class Explorer {
  constructor(bar, charts, span) {
    this.charts = charts;
    this.span = span;
    for (const [action, sign, words] of [["in", "+", "zoom in"], ["out", "−", "zoom out"], ["left", "←", "move left"], ["right", "→", "move right"], ["all", "All", "show all"]]) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = sign;
      button.title = button.ariaLabel = words;
      button.addEventListener("click", () => this.act(action));
      bar.append(button);
    }
    for (const chart of charts) this.follow(chart);
  }

  // The listeners are on the box, because a chart that is rebuilt for another colour scheme has a new canvas.
  follow(chart) {
    chart.box.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return;  // otherwise the page scrolls
      event.preventDefault();
      this.act(event.deltaY < 0 ? "in" : "out");
    }, { passive: false });
    let from = null;
    chart.box.addEventListener("pointerdown", (event) => { if (event.shiftKey) { from = [event.clientX, ...this.range()]; event.preventDefault(); event.stopPropagation(); } }, true);
    chart.box.addEventListener("pointermove", (event) => {
      if (from === null) return;
      const [x, low, high] = from, by = (x - event.clientX) / Math.max(chart.plot.over.clientWidth, 1) * (high - low);
      this.show([low + by, high + by]);
    });
    for (const end of ["pointerup", "pointerleave"]) chart.box.addEventListener(end, () => { from = null; });
    chart.box.addEventListener("dblclick", () => this.act("all"));
  }

  range() {
    const { min, max } = this.charts[0].plot.scales.x;
    return [min, max];
  }

  act(action) { this.show(shifted(this.range(), this.span, action)); }

  show([min, max]) { for (const chart of this.charts) chart.plot.setScale("x", { min, max }); }

  // Options of a chart in this group: a selection with the mouse sets the range of all its charts.
  static options(explorer, key) {
    return {
      cursor: { sync: { key, setSeries: false }, drag: { x: true, y: false, setScale: false } },
      hooks: {
        setSelect: [(plot) => {
          if (plot.select.width < 4 || !explorer()) return;
          const range = [plot.posToVal(plot.select.left, "x"), plot.posToVal(plot.select.left + plot.select.width, "x")];
          plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
          explorer().show(range);
        }],
      },
    };
  }
}

// Draw error bars of one standard uncertainty around the points of a series.
function errorBars(series, u) {
  return (plot) => {
    const { ctx } = plot, x = plot.data[0], y = plot.data[series];
    ctx.save();
    ctx.beginPath();
    ctx.rect(plot.bbox.left, plot.bbox.top, plot.bbox.width, plot.bbox.height);
    ctx.clip();
    ctx.strokeStyle = COLOURS.data;
    ctx.lineWidth = devicePixelRatio;
    ctx.beginPath();
    for (let i = 0; i < x.length; i++) {
      if (y[i] === null || y[i] === undefined || u[i] === null) continue;
      const at = plot.valToPos(x[i], "x", true);
      ctx.moveTo(at, plot.valToPos(y[i] - u[i], "y", true));
      ctx.lineTo(at, plot.valToPos(y[i] + u[i], "y", true));
    }
    ctx.stroke();
    ctx.restore();
  };
}

// Copy a text to the clipboard, even from a page that was opened from the disk.
async function copyText(text) {
  if (navigator.clipboard && isSecureContext) {
    try { await navigator.clipboard.writeText(text); return true; } catch { /* not allowed: use execCommand below */ }
  }
  const area = document.createElement("textarea");
  area.value = text;
  area.style.position = "fixed";
  area.style.opacity = "0";
  document.body.append(area);
  area.select();
  const done = document.execCommand("copy");
  area.remove();
  return done;
}
